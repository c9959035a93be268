// SPDX-License-Identifier: Apache-2.0
// raystage plan coverage: computes where a virtual camera may stand before an array.
#include <fmt/format.h>

#include <array>
#include <cmath>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/atomic_file.h"
#include "base/error.h"
#include "cli/follow_links_option.h"
#include "cli/plan.h"
#include "cli/printing.h"
#include "cli/shot_options.h"
#include "cli/threads.h"
#include "planning/combined_coverage.h"
#include "planning/coverage_plan.h"
#include "planning/coverage_report.h"
#include "planning/outward_coverage.h"

namespace raystage::cli {
namespace {

struct CoverageCommand {
  std::vector<std::filesystem::path> rigs;
  std::filesystem::path report, gltf;
  planning::CoverageOptions options;
  std::vector<double> shares_percent{100, 99, 90};
  double interaxial_mm = 0, tolerance_mm = 1;
  std::array<double, 3> subject{NAN, NAN, NAN};
  std::optional<double> subject_size;  // metres
  int threads = 0;
  bool json = false, transparent_arrays = false;
  ProgressStyle progress = ProgressStyle::kAuto;
};

constexpr double kMillimetres = 1000;

ExitCode run_coverage(const CoverageCommand& command, const std::stop_token& stop) {
  planning::CoverageOptions options = command.options;
  options.shares.clear();
  for (const double share : command.shares_percent) options.shares.push_back(share / kPercent);
  options.interaxial_m = command.interaxial_mm / kMillimetres;
  options.tolerance_m = command.tolerance_mm / kMillimetres;
  const auto [x, y, depth] = command.subject;
  if (!std::isnan(depth)) {
    constexpr double kUsualSize = 0.5;  // metres
    options.subject =
        planning::CoverageSubject{x, y, depth, command.subject_size.value_or(kUsualSize)};
  }
  if (!options.subject && command.subject_size) {
    throw Error::bad_input("there is no subject", "--subject-size", "Give --subject, too");
  }
  options.arrays_hide_each_other = !command.transparent_arrays;
  planning::NamedRig all;
  std::vector<planning::NamedRig> arrays;
  for (const std::filesystem::path& path : command.rigs) {
    planning::NamedRig named = read_named_rig(path);
    // Takes of one array have rigs of one name.
    if (command.rigs.size() > 1) named.name += " (" + path.string() + ")";
    all.name += (all.name.empty() ? "" : ", ") + named.name;
    all.rig.cameras.insert(all.rig.cameras.end(), named.rig.cameras.begin(),
                           named.rig.cameras.end());
    for (planning::NamedRig& side : planning::split_by_direction(named)) {
      arrays.push_back(std::move(side));
    }
  }
  Progress progress(command.progress);
  const auto report_progress = [&](double done) { progress.report(done); };
  const planning::CoveragePlan plan =
      arrays.size() == 1 && (!options.all_directions || planning::is_outward_array(arrays[0].rig))
          ? planning::plan_coverage(all.name, arrays[0].rig, options, report_progress, stop)
          : planning::plan_combined_coverage(all.name, arrays, options, report_progress, stop);
  if (!command.report.empty()) {
    write_file_atomically(command.report, planning::coverage_plan_as_page(plan));
  }
  if (!command.gltf.empty()) {
    write_file_atomically(command.gltf, planning::coverage_plan_as_gltf(plan, all.rig));
  }
  print(command.json ? planning::coverage_plan_as_json(plan)
                     : planning::format_coverage_plan(plan));
  return ExitCode::kSuccess;
}

}  // namespace

Subcommand declare_plan_coverage(CommandLine& plan) {
  auto options = std::make_shared<CoverageCommand>();
  CommandLine command = plan.subcommand(
      "coverage", "Compute where a virtual camera may stand so that its rays were recorded");
  command
      .option(
          "RIG|TAKE...", options->rigs,
          "the rig (rig.json), or a take; several ones, or cameras that look to all sides, count "
          "together")
      .required();
  command.option("--view-fov-deg DEG...", options->options.view_fov_deg,
                 "horizontal fields of view, degrees; one range for each (default: 30 45 60)");
  command.option(
      "--shares PERCENT...", options->shares_percent,
      "shares of a view's rays that must have been recorded, percent (default: 100 99 90)");
  command
      .option("--aspect RATIO", options->options.aspect,
              "width / height of the views (default: 1.333)")
      .limits(0.01, 100.0);
  command
      .option("--yaw-deg", options->options.yaw_deg,
              "turn of the views to the left against the array, degrees (default: 0); 90 or more: "
              "of arrays that look outwards")
      .limits(-180.0, 180.0);
  command
      .option("--pitch-deg", options->options.pitch_deg,
              "turn of the views upwards, degrees (default: 0)")
      .limits(-90.0, 90.0);
  command
      .option("--max-yaw-deg", options->options.max_yaw_deg,
              "the views turn by up to that to both sides, degrees (default: 0)")
      .limits(0.0, 180.0);
  command.flag("--all-directions", options->options.all_directions,
               "views of all directions instead of those of a field of view");
  command.flag(
      "--transparent-arrays", options->transparent_arrays,
      "several arrays do not hide anything from each other, as where they record one after "
      "the\nother (default: one does not see through another)");
  command
      .option("--interaxial-mm", options->interaxial_mm,
              "distance of the eyes of a stereo camera, millimetres (default: 0, one eye)")
      .limits(0.0, 1e6);
  command
      .option("--focal-depth", options->options.focal_depth_m,
              "focal plane in front of the array, metres (default: infinity)")
      .limits(1e-3, 1e9);
  command
      .option(
          "--subject X,Y,DEPTH", options->subject,
          "adds the range of views that must see a subject only: the middle of a cube, metres "
          "to the right,\nupwards and in front of the array. Of several arrays: states the "
          "directions from which they see it;\nfrom the middle of all cameras, along the axes of "
          "the first array")
      .comma_separated();
  command
      .option("--subject-size", options->subject_size,
              "edges of the subject's cube, metres (default: 0.5)")
      .limits(1e-6, 1e6);
  command
      .option("--tolerance-mm", options->tolerance_mm,
              "accuracy of ranges that are not exact, millimetres (default: 1)")
      .limits(0.01, 1e4);
  command.option("--gltf FILE.gltf", options->gltf,
                 "write the ranges and the array's cameras for Blender and other programs");
  command.option("--report FILE.html", options->report, "write the result as a page with drawings");
  command.flag("--json", options->json, "print the result with the surfaces as JSON");
  add_threads_option(command, options->threads);
  add_progress_option(command, options->progress);
  add_follow_links_option(command);
  return {command, [options](const std::stop_token& stop) {
            return run_with_threads(options->threads, [&] { return run_coverage(*options, stop); });
          }};
}

}  // namespace raystage::cli
