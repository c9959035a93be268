// SPDX-License-Identifier: Apache-2.0
// raystage render: renders a shot as an EXR sequence.
#include "base/error.h"
#include "cli/render_command.h"

namespace raystage::cli {
namespace {

void check_alone(const RenderOptions& options) {
  if (options.take_folders.empty() && options.fragments.empty() && options.jpeg_quality == 0) {
    return;
  }
  throw Error::bad_input("options for several hosts were given to a single process",
                         "--take-folder, --fragments, --fragment-quality",
                         "Use `mpirun -n RANKS raystage render ...`, or omit these options");
}

}  // namespace
}  // namespace raystage::cli

int main(int argc, char** argv) {
  using namespace raystage;
  using namespace raystage::cli;
  CommandLine command{"Renders a shot as an EXR sequence.", "raystage render"};
  RenderOptions options;
  declare_render_options(command, options, argv);
  return parse_and_run(command, argc, argv, "render", [&](std::stop_token stop) {
    check_alone(options);
    Progress progress(options.progress);
    return cli::render(options, progress, nullptr, "", stop);
  });
}
