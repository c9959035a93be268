// SPDX-License-Identifier: Apache-2.0
// raystage plan array: designs an array to a specification.
#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "base/atomic_file.h"
#include "cli/plan.h"
#include "cli/printing.h"
#include "cli/shot_options.h"
#include "cli/threads.h"
#include "planning/arrays/array_plan.h"
#include "planning/arrays/array_report.h"
#include "planning/arrays/array_trial.h"
#include "raystage_version.h"
#include "schemas/array_specification.h"

namespace raystage::cli {
namespace {

struct ArrayCommand {
  std::filesystem::path specification, report, rig;
  int simulated = 0, threads = 0;
  bool json = false;
  ProgressStyle progress = ProgressStyle::kAuto;
};

/// Returns the best alternative and then others of the front, those with least ghosting that are
/// not simply larger.
std::vector<std::size_t> alternatives_to_try(const planning::ArrayPlan& plan, std::size_t count) {
  std::vector<std::size_t> chosen;
  if (count > 0) chosen.push_back(*plan.best);
  for (std::size_t i = plan.alternatives.size(); i-- > 0 && chosen.size() < count;) {
    if (plan.alternatives[i].is_on_front && i != *plan.best) chosen.push_back(i);
  }
  std::ranges::sort(chosen);
  return chosen;
}

ExitCode run_array(const ArrayCommand& command, const std::stop_token& stop) {
  const planning::ArrayPlan plan = planning::plan_array(
      schemas::read_array_specification(command.specification), command.specification.string());
  Progress progress(command.progress);
  const std::vector<planning::ArrayTrial> trials = planning::try_arrays(
      plan, alternatives_to_try(plan, static_cast<std::size_t>(command.simulated)),
      "raystage " RAYSTAGE_VERSION, [&](double done) { progress.report(done); }, stop);
  if (!command.rig.empty()) {
    schemas::write_rig(planning::rig_of_alternative(plan, plan.alternatives[*plan.best]),
                       command.rig);
  }
  if (!command.report.empty()) {
    write_file_atomically(command.report, planning::array_plan_as_page(plan, trials));
  }
  print(command.json ? planning::array_plan_as_json(plan, trials)
                     : planning::format_array_plan(plan, trials));
  return plan.alternatives[*plan.best].is_sufficient ? ExitCode::kSuccess : ExitCode::kFellShort;
}

}  // namespace

Subcommand declare_plan_array(CommandLine& plan) {
  auto options = std::make_shared<ArrayCommand>();
  CommandLine command =
      plan.subcommand("array", "Design an array for the views that it must be able to show");
  command
      .option("SPECIFICATION", options->specification,
              "what is wanted and what is at hand (docs/planning.md)")
      .required();
  command.option("--rig FILE.json", options->rig,
                 "write the rig of the best array, for plan coverage and plan resolution");
  command
      .option("--simulate N", options->simulated,
              "alternatives that are simulated and measured, the best one first (default: 0)")
      .limits(0.0, 100.0);
  command.option("--report FILE.html", options->report, "write the result as a page with charts");
  command.flag("--json", options->json, "print the result as JSON");
  add_threads_option(command, options->threads);
  add_progress_option(command, options->progress);
  return {command, [options](const std::stop_token& stop) {
            return run_with_threads(options->threads, [&] { return run_array(*options, stop); });
          }};
}

}  // namespace raystage::cli
