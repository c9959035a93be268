// SPDX-License-Identifier: Apache-2.0
// raystage render: a shot as an EXR sequence.
#include "base/error.h"
#include "cli/render_command.h"

namespace raystage {
namespace {

void check_alone(const RenderOptions& options) {
  if (options.take_folders.empty() && !options.missing_archives && options.fragments.empty() &&
      options.jpeg_quality == 0) {
    return;
  }
  throw Error::bad_input(
      "there is one process, and options for several hosts",
      "--take-folder, --missing-archives, --fragments, --fragment-quality",
      "Start it as `mpirun -n RANKS raystage render ...`, or leave these options out");
}

}  // namespace
}  // namespace raystage

int main(int argc, char** argv) {
  using namespace raystage;
  CLI::App app{"Renders a shot as an EXR sequence.", "raystage render"};
  RenderOptions options;
  declare_render_options(app, options, argv);
  return parse_and_run(app, argc, argv, "render", [&](std::stop_token stop) {
    check_alone(options);
    Progress progress(options.progress);
    return render(options, progress, nullptr, "", stop);
  });
}
