// SPDX-License-Identifier: Apache-2.0
// raystage plan resolution: computes how many distinct pixels views before an array have.
#include <fmt/format.h>

#include <filesystem>
#include <memory>

#include "base/atomic_file.h"
#include "cli/follow_links_option.h"
#include "cli/plan.h"
#include "cli/printing.h"
#include "planning/resolution_plan.h"

namespace raystage::cli {
namespace {

struct ResolutionCommand {
  std::filesystem::path rig, report;
  planning::ResolutionOptions options;
  bool json = false, quiet = false;
};

ExitCode run_plan(const ResolutionCommand& command) {
  const planning::NamedRig named = read_named_rig(command.rig);
  const planning::ResolutionPlan plan =
      planning::plan_resolution(named.name, named.rig, command.options);
  if (!command.report.empty()) {
    write_file_atomically(command.report, planning::resolution_plan_as_page(plan));
  }
  print(command.json ? planning::resolution_plan_as_json(plan)
                     : planning::format_resolution_plan(plan));
  return ExitCode::kSuccess;
}

}  // namespace

Subcommand declare_plan_resolution(CommandLine& plan) {
  auto options = std::make_shared<ResolutionCommand>();
  CommandLine command = plan.subcommand(
      "resolution",
      "Compute how many pixels of a view come from distinct samples of the light field");
  command.option("RIG|TAKE", options->rig, "the rig (rig.json), or a take").required();
  command
      .option("--view-fov-deg", options->options.view_fov_deg,
              "field of view of the views, degrees (default: 45)")
      .limits(0.01, 179.0);
  command
      .option("--max-rotation-deg", options->options.max_rotation_deg,
              "largest rotation of the views to both sides, degrees (default: 15)")
      .limits(0.0, 89.9);
  command
      .option("--depth", options->options.depth_m,
              "position of the views in front of the array, metres; negative: behind it. It "
              "matters only\nfor skewed cameras (default: 0)")
      .limits(-1e6, 1e6);
  command.choice(
      "--axis", options->options.axis,
      {{"horizontal", rig::ArrayAxis::kHorizontal}, {"vertical", rig::ArrayAxis::kVertical}},
      "axis of the array (default: horizontal)");
  command.option("--report FILE.html", options->report, "write the result as a page with charts");
  command.flag("--json", options->json, "print the result as JSON");
  add_follow_links_option(command);
  command.flag("-q,--quiet", options->quiet,
               "No effect: accepted as by other commands, which report their progress");
  return {command, [options](const std::stop_token&) { return run_plan(*options); }};
}

}  // namespace raystage::cli
