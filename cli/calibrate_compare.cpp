// SPDX-License-Identifier: Apache-2.0
// raystage calibrate compare: compares two rigs of the same cameras.
#include <fmt/format.h>

#include <filesystem>
#include <memory>

#include "calibrate/geometry/rig_comparison.h"
#include "cli/calibrate.h"
#include "cli/printing.h"

namespace raystage::cli {
namespace {

struct CompareOptions {
  std::filesystem::path first, second;
  double nearest_m = 0;
  bool json = false;
};

}  // namespace

Subcommand declare_calibrate_compare(CommandLine& calibrate) {
  auto options = std::make_shared<CompareOptions>();
  CommandLine command = calibrate.subcommand("compare",
                                             "Compare two rigs of the same cameras after aligning "
                                             "the second with the first by a similarity transform");
  command.option("A", options->first, "The first rig (rig.json)").required();
  command.option("B", options->second, "The second rig (rig.json)").required();
  command
      .option("--nearest", options->nearest_m,
              "Distance of the nearest points whose pixels are compared, metres; the others are at "
              "two and four times this distance and at infinity (default: ten times the distance "
              "of adjacent cameras)")
      .limits(1e-6, 1e6);
  command.flag("--json", options->json, "Print the results as JSON");
  return {command, [options](const std::stop_token&) {
            const calibrate::RigComparison comparison =
                calibrate::compare_rigs(schemas::read_rig(options->first),
                                        schemas::read_rig(options->second), options->nearest_m);
            print(options->json ? calibrate::rig_comparison_json(comparison)
                                : calibrate::format_rig_comparison(comparison));
            return ExitCode::kSuccess;
          }};
}

}  // namespace raystage::cli
