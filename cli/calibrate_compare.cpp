// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <filesystem>
#include <memory>

#include "calibrate/geometry/rig_comparison.h"
#include "cli/calibrate.h"

namespace raystage {
namespace {

struct CompareOptions {
  std::filesystem::path first, second;
  double nearest_m = 0;
  bool json = false;
};

}  // namespace

CalibrateCommand declare_calibrate_compare(CLI::App& calibrate) {
  auto options = std::make_shared<CompareOptions>();
  CLI::App* app = calibrate.add_subcommand(
      "compare",
      "How two rigs of the same cameras differ, once the second is brought over the first by a "
      "rotation, a scale and a shift");
  app->add_option("A", options->first, "The first rig (rig.json)")->required();
  app->add_option("B", options->second, "The second rig (rig.json)")->required();
  app->add_option(
         "--nearest", options->nearest_m,
         "Distance of the nearest points whose pixels are compared, metres; further ones "
         "are twice and four times as far and at infinity (default: ten times the distance "
         "from one camera to the next)")
      ->check(CLI::Range(1e-6, 1e6).description(""));
  app->add_flag("--json", options->json, "Print everything as JSON");
  return {app, [options](const std::stop_token&) {
            const RigComparison comparison = compare_rigs(
                read_rig(options->first), read_rig(options->second), options->nearest_m);
            fmt::print("{}", options->json ? rig_comparison_json(comparison)
                                           : format_rig_comparison(comparison));
            return ExitCode::kSuccess;
          }};
}

}  // namespace raystage
