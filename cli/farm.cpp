// SPDX-License-Identifier: Apache-2.0
// raystage farm: renders a shot as tasks on many machines.
#include "cli/farm.h"

#include <vector>

int main(int argc, char** argv) {
  using namespace raystage;
  using namespace raystage::cli;
  CommandLine command(
      "Renders a shot on many machines, or with the same tasks on this one. Guide: docs/farm.md.",
      "raystage farm");
  const std::vector<Subcommand> subcommands{
      declare_farm_submit(command), declare_farm_status(command),   declare_farm_logs(command),
      declare_farm_retry(command),  declare_farm_cancel(command),   declare_farm_doctor(command),
      declare_farm_export(command), declare_farm_estimate(command), declare_farm_task(command)};
  command.footer(
      "Exit codes: 0 all requested frames are complete; 1 failed; 2 bad usage or input;\n"
      "3 some frames failed, the rest is done; 4 all complete, some fall short "
      "(below\n--least-coverage, or cameras with\nrotten frames are absent);\n"
      "33 out of memory; 128+n stopped by signal n.");
  return parse_and_run(command, argc, argv, "farm", subcommands, {{"--wrap", "--command-prefix"}});
}
