// SPDX-License-Identifier: Apache-2.0
// raystage plan check: states what the cameras recorded of the frames of a shot, before it is
// rendered.
#include <fmt/format.h>

#include <filesystem>
#include <limits>
#include <memory>
#include <numbers>
#include <optional>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "base/atomic_file.h"
#include "base/error.h"
#include "cli/follow_links_option.h"
#include "cli/plan.h"
#include "cli/printing.h"
#include "cli/shot_options.h"
#include "cli/threads.h"
#include "compose/frame_range.h"
#include "compose/sequence.h"
#include "compose/shot_plan.h"
#include "planning/camera_motion.h"
#include "planning/nearest_path.h"
#include "planning/shot_check.h"
#include "planning/shot_check_report.h"
#include "schemas/shot_document.h"

namespace raystage::cli {
namespace {

constexpr double kNoLimit = std::numeric_limits<double>::infinity();

struct CheckCommand {
  std::filesystem::path shot, report, nearest_path, relative_to, bench;
  std::string frames;
  compose::MissingFrames missing = compose::MissingFrames::kError;
  double least_coverage = 0, least_resolution = 0;  ///< shares
  int threads = 0;
  bool json = false, quiet = false;
  bool is_milo = false;           // the limits of a known rig
  planning::MotionLimits limits;  // in place of those
  double turn_speed_deg = kNoLimit;
};

planning::MotionLimits motion_limits_of(const CheckCommand& command) {
  planning::MotionLimits limits =
      command.is_milo ? planning::milo_motion_limits() : planning::MotionLimits{};
  const auto replace = [](double& limit, double given) {
    if (given < kNoLimit) limit = given;
  };
  replace(limits.reach, command.limits.reach);
  replace(limits.extension_speed, command.limits.extension_speed);
  replace(limits.track_speed, command.limits.track_speed);
  replace(limits.acceleration, command.limits.acceleration);
  replace(limits.turn_speed, command.turn_speed_deg * std::numbers::pi / 180);
  return limits;
}

/// Returns whether the shot reaches what is asked for.
bool is_enough(const planning::ShotCheck& check, const CheckCommand& command) {
  if (command.least_coverage == 0 && command.least_resolution == 0) return true;
  return check.has_frames() && 1 - check.worst_unrecorded_share() >= command.least_coverage &&
         check.worst_resolution() >= command.least_resolution;
}

/// Returns the numbers of the layers with a take. Meshes and plates need not be read.
std::vector<std::string> light_field_layers(const schemas::ShotDocument& shot) {
  std::vector<std::string> layers;
  for (std::size_t i = 0; i < shot.layers.size(); ++i) {
    if (shot.layers[i].is_light_field()) layers.push_back(std::to_string(i));
  }
  return layers;
}

/// Throws Error (bad input) if a file that is written is the shot.
void check_target(const std::filesystem::path& target, const std::filesystem::path& shot) {
  std::error_code none;
  if (target.empty() || !std::filesystem::equivalent(target, shot, none)) return;
  throw Error::bad_input("the result would replace the shot", target.string(), "Give another file");
}

/// Writes the given shot with the camera of the nearest path.
void write_nearest_path(const CheckCommand& command, schemas::ShotDocument shot,
                        const compose::ShotPlan& plan, const std::stop_token& stop) {
  planning::NearestPath path = planning::find_nearest_path(plan, command.shot.string(), stop);
  for (const std::string& ignored : path.ignored_takes) {
    print_error("warning: the range of motion of a take is not known, {}\n", ignored);
  }
  shot.camera = std::move(path.shot.camera);  // the plan hides layers without a take
  write_file_atomically(command.nearest_path, schemas::format_shot(shot));
  if (command.quiet) return;
  const std::string file = command.nearest_path.string();
  if (path.largest_shift == 0) {
    print_error("{}: no shift of the camera is needed\n", file);
  } else {
    print_error("{}: the camera is shifted by up to {:.3f} m, most at frame {}\n", file,
                path.largest_shift, path.largest_shift_frame);
  }
}

ExitCode run_check(const CheckCommand& command, const std::stop_token& stop) {
  std::optional<std::vector<int>> requested;
  if (!command.frames.empty()) requested = compose::parse_frame_range(command.frames);
  compose::ShotPlanOptions options;
  options.frames = requested;
  options.folder = command.relative_to;
  check_target(command.report, command.shot);
  check_target(command.nearest_path, command.shot);
  const schemas::ShotDocument shot = schemas::read_shot(command.shot);
  options.draft.layers = light_field_layers(shot);
  const compose::ShotPlan plan(shot, command.shot, options);
  const std::vector<int> numbers =
      compose::frames_to_render(plan.shot(), requested, [&](std::string_view warning) {
        if (!command.quiet) print_error("{}\n", warning);
      });
  const auto frames = plan.plan(numbers, command.missing);
  planning::ShotCheckOptions checked;
  checked.motion_limits = motion_limits_of(command);
  if (!command.bench.empty()) {
    checked.measured_settings = planning::read_measured_settings(command.bench);
  }
  const planning::ShotCheck check =
      planning::check_shot(plan, command.shot.string(), frames, checked, stop);
  if (!command.report.empty()) {
    write_file_atomically(command.report, planning::shot_check_as_page(check));
  }
  print(command.json ? planning::shot_check_as_json(check) : planning::format_shot_check(check));
  if (!command.nearest_path.empty()) write_nearest_path(command, shot, plan, stop);
  return is_enough(check, command) ? ExitCode::kSuccess : ExitCode::kFellShort;
}

}  // namespace

Subcommand declare_plan_check(CommandLine& plan) {
  auto options = std::make_shared<CheckCommand>();
  CommandLine command = plan.subcommand(
      "check", "Compute what the cameras recorded of the frames of a shot, before it is rendered");
  command.option("SHOT", options->shot, "the shot (shot.json)").required();
  command.option("--frames RANGE", options->frames,
                 "frames to check, e.g. 1-48 or 1,5,10-20x2 (default: all of the shot)");
  add_missing_option(command, options->missing);
  add_relative_to_option(command, options->relative_to);
  command
      .option("--least-coverage SHARE", options->least_coverage,
              "exit with 4 if fewer of the rays of a frame were recorded, 0 to 1 (default: 0)")
      .limits(0.0, 1.0);
  command
      .option("--least-resolution SHARE", options->least_resolution,
              "exit with 4 if the effective resolution of a frame is less than that share of the "
              "shot's,\n0 to 1 (default: 0)")
      .limits(0.0, 1.0);
  command
      .option("--nearest-path FILE.json", options->nearest_path,
              "write the shot, all of its frames, with its camera moved into the range of motion; "
              "paths stay\nrelative to the folder of SHOT")
      .excludes("--frames");
  command.option(
      "--bench trade.json", options->bench,
      "state what a bench of the take measured (raystage bench), and the setting that it "
      "suggests");
  command.flag("--milo", options->is_milo,
               "compare the path with what the motion control rig of thesis 7.3.2 can do");
  command
      .option("--rig-reach", options->limits.reach, "reach of a motion control rig's arm, metres")
      .limits(0.0, 1e6);
  command.option("--rig-extension-speed", options->limits.extension_speed, "speed of its arm, m/s")
      .limits(0.0, 1e6);
  command.option("--rig-track-speed", options->limits.track_speed, "speed on its track, m/s")
      .limits(0.0, 1e6);
  command.option("--rig-acceleration", options->limits.acceleration, "its acceleration, m/s2")
      .limits(0.0, 1e6);
  command.option("--rig-turn-speed-deg", options->turn_speed_deg, "its rotation, degrees/s")
      .limits(0.0, 1e6);
  command.option("--report FILE.html", options->report, "write the result as a page with charts");
  command.flag("--json", options->json, "print the result as JSON");
  add_threads_option(command, options->threads);
  add_follow_links_option(command);
  command.flag("-q,--quiet", options->quiet,
               "No notes on stderr: about --nearest-path, and frames that are left out");
  return {command, [options](const std::stop_token& stop) {
            return run_with_threads(options->threads, [&] { return run_check(*options, stop); });
          }};
}

}  // namespace raystage::cli
