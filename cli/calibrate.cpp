// SPDX-License-Identifier: Apache-2.0
// raystage calibrate: where the cameras of an array stand and look, their lenses and colours.
#include "cli/calibrate.h"

#include <vector>

#include "cli/command_line_parsing.h"

int main(int argc, char** argv) {
  using namespace raystage;
  CLI::App app(
      "Finds an array's geometry and colour. docs/calibration.md says what to record for it.",
      "raystage calibrate");
  app.require_subcommand(1);
  const std::vector<CalibrateCommand> commands{
      declare_calibrate_lens(app), declare_calibrate_geometry(app), declare_calibrate_color(app),
      declare_calibrate_compare(app)};
  app.footer(
      "Exit codes: 0 all asked for is written; 1 failed, or a rejected result was\n"
      "not written; 2 bad usage or input.");
  for (const CalibrateCommand& command : commands) command.app->get_formatter()->column_width(34);
  return parse_and_run(app, argc, argv, "calibrate",
                       [&](std::stop_token stop) {
                         for (const CalibrateCommand& command : commands) {
                           if (!command.app->parsed()) continue;
                           reject_non_finite(*command.app);
                           return command.body(stop);
                         }
                         return ExitCode::kBadInput;
                       },
                       OnSignal::kAbort,
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
