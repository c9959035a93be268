// SPDX-License-Identifier: Apache-2.0
// raystage farm: renders a shot as tasks on many machines.
#include "cli/farm.h"

#include <vector>

#include "cli/command_line_parsing.h"

int main(int argc, char** argv) {
  using namespace raystage;
  CLI::App app(
      "Renders a shot on many machines, or with the same tasks on this one. Guide: docs/farm.md.",
      "raystage farm");
  app.require_subcommand(1);
  const std::vector<FarmCommand> commands{
      declare_farm_submit(app), declare_farm_status(app),   declare_farm_logs(app),
      declare_farm_retry(app),  declare_farm_cancel(app),   declare_farm_doctor(app),
      declare_farm_export(app), declare_farm_estimate(app), declare_farm_task(app)};
  app.footer(
      "Exit codes: 0 all requested frames are complete; 1 failed; 2 bad usage or input;\n"
      "3 some frames failed, the rest is done; 33 out of memory; 128+n stopped by signal n.");
  for (const FarmCommand& command : commands) command.app->get_formatter()->column_width(34);
  return parse_and_run(app, argc, argv, "farm",
                       [&](std::stop_token stop) {
                         for (const FarmCommand& command : commands) {
                           if (!command.app->parsed()) continue;
                           reject_non_finite(*command.app);
                           return command.body(stop);
                         }
                         return ExitCode::kBadInput;
                       },
                       OnSignal::kAbort, {{"--wrap", "--command-prefix"}});
}
