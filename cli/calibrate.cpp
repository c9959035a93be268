// SPDX-License-Identifier: Apache-2.0
// raystage calibrate: estimates poses, lenses and colours of an array's cameras, compares rigs.
#include "cli/calibrate.h"

#include <vector>

int main(int argc, char** argv) {
  using namespace raystage;
  using namespace raystage::cli;
  CommandLine command(
      "Calibrates geometry and colour of an array. docs/calibration.md describes the recordings.",
      "raystage calibrate");
  const std::vector<Subcommand> subcommands{
      declare_calibrate_lens(command), declare_calibrate_geometry(command),
      declare_calibrate_color(command), declare_calibrate_compare(command)};
  command.footer(
      "Exit codes: 0 written; 1 failed, or a rejected result was not written; 2 bad usage or "
      "input.");
  return parse_and_run(command, argc, argv, "calibrate", subcommands,
                       {{"--at", "--time"},
                        {"--fov", "--fov-deg"},
                        {"--hold", "--fix"},
                        {"--max-rms", "--max-rms-px"},
                        {"--one-kind", "--shared-lens-prior"},
                        {"--points", "--max-points"},
                        {"--published", "--reference-values"},
                        {"--second-light", "--ambiguity-ratio"},
                        {"--sheet", "--contact-sheet"},
                        {"--sheet-of", "--contact-sheet-take"},
                        {"--start", "--initial-rig"},
                        {"--trust-clocks", "--no-clock-estimation"},
                        {"--views", "--max-views"},
                        {"--whole-lens-model", "--full-lens-model"}});
}
