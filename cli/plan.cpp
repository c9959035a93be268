// SPDX-License-Identifier: Apache-2.0
// raystage plan: computes what an array can show, before it is shot or rendered.
#include "cli/plan.h"

#include <vector>

int main(int argc, char** argv) {
  using namespace raystage;
  using namespace raystage::cli;
  CommandLine command(
      "Computes what an array of cameras can show, before it is shot or rendered. docs/planning.md "
      "explains the results.",
      "raystage plan");
  const std::vector<Subcommand> subcommands{
      declare_plan_array(command), declare_plan_check(command), declare_plan_coverage(command),
      declare_plan_epi(command), declare_plan_resolution(command)};
  command.footer(
      "Exit codes: 0 computed; 1 failed; 2 bad usage or input; 4 the shot falls short of what\n"
      "--least-coverage or --least-resolution ask for, epi found no depth range, or\n"
      "no array is as specified.");
  return parse_and_run(command, argc, argv, "plan", subcommands, {});
}
