// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <memory>
#include <numbers>
#include <numeric>
#include <optional>
#include <string>
#include <vector>

#include "base/atomic_file.h"
#include "calibrate/detect/board_detection.h"
#include "calibrate/detect/feature_matching.h"
#include "calibrate/geometry/calibration.h"
#include "calibrate/geometry/calibration_report.h"
#include "calibrate/track_calibration.h"
#include "cli/board_options.h"
#include "cli/calibrate.h"
#include "cli/threads.h"
#include "store/timeline.h"

namespace raystage {
namespace {

struct GeometryOptions {
  std::filesystem::path input, cameras, output, start, lens, report, detections;
  std::vector<std::string> hold, distance;
  std::string name;
  std::optional<double> fov_deg, spacing_mm;
  double max_rms_px = 1;
  bool lens_per_camera = false, full_lens_model = false;
  std::optional<double> at_s;
  bool features = false, trust_clocks = false, force = false, json = false, quiet = false;
  int threads = 0;
  std::optional<int> max_points;
  LightDetectionSettings light;
  BoardOptions board;
};

/// The lens of a rig file for every camera: by id, or the file's only one for all.
std::vector<Intrinsics> lenses_from(const std::filesystem::path& file,
                                    const Detections& detections) {
  const RigDocument rig = read_rig(file);
  std::vector<Intrinsics> lenses;
  for (const auto& camera : detections.cameras) {
    const auto own = std::ranges::find_if(
        rig.cameras, [&](const auto& known) { return known.geometry.id == camera.id; });
    if (own == rig.cameras.end() && rig.cameras.size() > 1) {
      throw Error::bad_input("there is no lens for camera \"" + camera.id + "\"", file.string(),
                             "Give a rig with all cameras, or with one camera, whose lens is then "
                             "taken for all");
    }
    const CameraGeometry& geometry =
        own == rig.cameras.end() ? rig.cameras.front().geometry : own->geometry;
    if (geometry.width != camera.width || geometry.height != camera.height) {
      throw Error::bad_input(
          fmt::format("the lens is for pictures of {}x{}, camera \"{}\" has {}x{}", geometry.width,
                      geometry.height, camera.id, camera.width, camera.height),
          file.string(), "Measure the lens at the frame size that is recorded");
    }
    lenses.push_back(geometry.intrinsics);
  }
  return lenses;
}

ScaleSettings scale_of(const GeometryOptions& options) {
  ScaleSettings scale;
  if (options.spacing_mm) scale.spacing_m = *options.spacing_mm / 1000;
  if (options.distance.empty()) return scale;
  double metres = 0;
  try {
    metres = std::stod(options.distance[2]);
  } catch (const std::exception&) {
  }
  if (!(metres > 0)) {
    throw Error::bad_input("found " + options.distance[2] + ", allowed: metres above 0",
                           "--distance", "Give two cameras and the distance between their lenses");
  }
  scale.distance = {options.distance[0], options.distance[1], metres};
  return scale;
}

CalibrationSettings settings_of(const GeometryOptions& options, const Detections& detections,
                                const std::stop_token& stop) {
  CalibrationSettings settings;
  settings.solve.stop = stop;
  if (!options.quiet) {
    settings.solve.on_step = [lines = std::make_shared<Progress>()](const SolveStep& step) {
      lines->say(fmt::format("Solved for {}: {:.3f} px RMS", step.what, step.rms_px));
    };
  }
  settings.scale = scale_of(options);
  settings.limits.max_rms_px = options.max_rms_px;
  settings.solve.lens_per_camera = options.lens_per_camera;
  settings.solve.full_lens_model = options.full_lens_model;
  if (options.fov_deg) settings.solve.horizontal_fov = *options.fov_deg * std::numbers::pi / 180;
  if (!options.start.empty()) settings.start = read_rig(options.start);
  if (!options.lens.empty()) settings.solve.lenses = lenses_from(options.lens, detections);
  for (const std::string& held : options.hold) {
    if (held == "lens") {
      settings.solve.lens_is_known = true;
    } else if (held == "poses") {
      settings.fixes_all_poses = true;
    } else {
      settings.fixed_cameras.push_back(held);
    }
  }
  if (settings.solve.lens_is_known && options.lens.empty() && options.start.empty()) {
    throw Error::bad_input("the lens is to be held, and nothing says what it is", "--hold lens",
                           "Give it with --lens (raystage calibrate lens), or a rig with --start");
  }
  std::vector<std::string> named = settings.fixed_cameras;
  if (settings.scale.distance) {
    named.insert(named.end(), {settings.scale.distance->from, settings.scale.distance->to});
  }
  for (const std::string& id : named) {
    if (std::ranges::find(detections.cameras, id, &DetectionsDocument::Camera::id) !=
        detections.cameras.end()) {
      continue;
    }
    throw Error::bad_input("there is no camera \"" + id + "\"", "--hold or --distance",
                           "Name cameras of what is calibrated; --hold also knows lens and poses");
  }
  return settings;
}

/// Follows the light through a take.
RecordedTracks light_in(const GeometryOptions& options, const std::stop_token& stop) {
  const Take take(options.input);
  const auto times = synchronised_frame_times(take);
  Progress progress(!options.quiet);
  RecordedTracks light{
      track_light(
          take, times, options.light, [&](double done) { progress.report(done); }, stop),
      detection_cameras(take), median_frame_period(times)};
  if (!options.json) fmt::print("{}", format_track_summary(light.tracks, light.cameras));
  return light;
}

void write_tracked(const Detections& detections, const std::filesystem::path& table) {
  write_detections(detections, table);
  write_detections_document({detections.cameras},
                            std::filesystem::path(table).replace_extension(".cameras.json"));
}

Detections table_of(const GeometryOptions& options) {
  const std::filesystem::path cameras =
      options.cameras.empty() ? options.input.parent_path() / "cameras.json" : options.cameras;
  return read_detections(options.input, read_detections_document(cameras));
}

struct Found {
  CalibrationSettings settings;
  Calibration calibration;
};

/// What was followed becomes an array, and its clocks.
Found found_from(const RecordedTracks& recording, TrackCalibrationSettings settings,
                 const GeometryOptions& options) {
  settings.estimates_clock_offsets = !options.trust_clocks;
  const TrackCalibration found = calibrate_from_tracks(recording, settings);
  if (!options.detections.empty()) write_tracked(found.points.detections, options.detections);
  if (!options.json && settings.estimates_clock_offsets) {
    fmt::print("{}", format_clock_offsets(found, recording.cameras));
  }
  return {settings.calibration, found.calibration};
}

Found found_in_take(const GeometryOptions& options, const std::stop_token& stop) {
  TrackCalibrationSettings settings;
  settings.points.max_points = options.max_points.value_or(settings.points.max_points);
  settings.calibration = settings_of(options, {detection_cameras(Take(options.input)), {}}, stop);
  const RecordedTracks light = light_in(options, stop);
  return found_from(light, settings, options);
}

Found found_by_board(const GeometryOptions& options, const std::stop_token& stop) {
  const BoardDetector finder(make_board(options.board, true));
  const Take take(options.input);
  TrackCalibrationSettings settings;
  settings.calibration = settings_of(options, {detection_cameras(take), {}}, stop);
  const auto times = synchronised_frame_times(take);
  Progress progress(!options.quiet);
  const RecordedTracks board{
      track_board_corners(
          take, times, finder, [&](double done) { progress.report(done); }, stop),
      detection_cameras(take), median_frame_period(times)};
  constexpr int kInstants = 80;  // each has a board's corners
  settings.points.max_points = options.max_points.value_or(kInstants);
  settings.points.prefers_still_instants = true;
  settings.points.min_step_px = 0;
  settings.points.max_curvature_px = 20;  // frames lie near to the instants
  settings.calibration.board = finder.board().all_corners();
  return found_from(board, settings, options);
}

Found found_by_features(const GeometryOptions& options, const std::stop_token& stop) {
  const Take take(options.input);
  const CalibrationSettings settings = settings_of(options, {detection_cameras(take), {}}, stop);
  FeatureMatchingSettings features;
  features.max_points = options.max_points.value_or(features.max_points);
  Progress progress(!options.quiet);
  const TimeRange all = running_range(synchronised_frame_times(take));
  const Nanoseconds at = options.at_s ? static_cast<Nanoseconds>(std::llround(*options.at_s * 1e9))
                                      : std::midpoint(all.begin, all.end);
  const Detections detections = match_features(
      take, at, tolerance_of_stamps(take.document().nominal_fps), features,
      [&](double done) { progress.report(done); }, stop);
  if (!options.detections.empty()) write_tracked(detections, options.detections);
  return {settings, calibrate(detections, settings)};
}

Found found_in_table(const GeometryOptions& options, const std::stop_token& stop) {
  const Detections detections = table_of(options);
  const CalibrationSettings settings = settings_of(options, detections, stop);
  return {settings, calibrate(detections, settings)};
}

ExitCode calibrate_geometry(const GeometryOptions& options, const std::stop_token& stop) {
  const ThreadLimit limit(options.threads);
  check_writable(options.output);
  if (!options.report.empty()) check_writable(options.report);
  if (!options.detections.empty()) check_writable(options.detections);
  const bool is_take = std::filesystem::is_directory(options.input);
  const bool has_board = !options.board.squares.empty();
  if (has_board && !is_take) {
    throw Error::bad_input("a board is looked for in a take", options.input.string(),
                           "Give the take that shows the board, or leave --board out");
  }
  if (options.features && (has_board || !is_take)) {
    throw Error::bad_input("features are looked for in a take, without a board", "--features",
                           "Give a take of a scene that stands still, and no --board");
  }
  const auto [settings, calibration] = options.features ? found_by_features(options, stop)
                                       : has_board      ? found_by_board(options, stop)
                                       : is_take        ? found_in_take(options, stop)
                                                        : found_in_table(options, stop);
  fmt::print("{}", options.json ? calibration_report_json(calibration)
                                : format_calibration_report(calibration));
  if (!options.report.empty()) {
    write_file_atomically(options.report,
                          calibration_report_html(calibration, options.output.string()));
  }
  const bool is_sure = calibration.verdict.is_accepted();
  if (!is_sure && !options.force) {
    throw Error::failed("the rig was not written: the calibration was rejected (see \"Not sure\")",
                        options.output.string(),
                        "Follow the advice under \"Next\", or use --force to write it anyway");
  }
  write_rig(make_rig_document(calibration, settings.start, options.name), options.output);
  return ExitCode::kSuccess;
}

void add_inputs(CLI::App& app, GeometryOptions& o) {
  app.add_option("INPUT", o.input,
                 "A take of a small light that was carried about in the dark, with --board of a "
                 "board that was shown to several cameras at once, with --features of a scene that "
                 "stands still; or a table of "
                 "detections, camera,frame,u,v (docs/formats/documents.md#detections)")
      ->required()
      ->type_name("TAKE|FILE.csv");
  app.add_option("--cameras", o.cameras,
                 "The document with the table's cameras (default: cameras.json beside it)")
      ->type_name("FILE.json");
  app.add_option("-o,--output", o.output, "The rig that is written")
      ->required()
      ->type_name("RIG.json");
  app.add_option("--name", o.name, "What people call the rig")->default_val("calibrated array");
}

void add_knowledge(CLI::App& app, GeometryOptions& o) {
  const char* group = "What is known";
  app.add_option("--spacing-mm", o.spacing_mm,
                 "Distance from one camera to the next, millimetres: tells the scale")
      ->check(CLI::Range(1e-3, 1e7).description(""))
      ->group(group);
  app.add_option("--distance", o.distance,
                 "Measured distance between the lenses of two cameras, metres: tells the scale")
      ->expected(3)
      ->type_name("ID ID METRES")
      ->excludes("--spacing-mm")
      ->group(group);
  app.add_option(
         "--fov", o.fov_deg,
         "Horizontal field of view of all cameras, degrees, to begin with (default: several "
         "are tried)")
      ->check(CLI::Range(2.0, 160.0).description(""))
      ->group(group);
  app.add_option("--lens", o.lens,
                 "Lenses to begin with: a rig with one camera (its lens is taken for all) or with "
                 "all of them")
      ->type_name("RIG.json")
      ->group(group);
  app.add_option("--start", o.start,
                 "A rig to begin with and to refine: lenses, poses, scale and world")
      ->type_name("RIG.json")
      ->excludes("--lens")
      ->group(group);
  app.add_option("--hold", o.hold,
                 "Stays as it is: 'lens' (all lenses), 'poses' (all poses) or a camera's id (its "
                 "pose); may be repeated")
      ->allow_extra_args(false)
      ->type_name("WHAT")
      ->group(group);
}

void add_light(CLI::App& app, GeometryOptions& o) {
  const char* group = "The light, in a take";
  app.add_option("--light-threshold", o.light.min_light,
                 "Least brightness of the light above what is there without it, linear, full scale "
                 "1")
      ->capture_default_str()
      ->check(CLI::Range(0.001, 1.0).description(""))
      ->group(group);
  app.add_option("--second-light", o.light.ambiguity_ratio,
                 "Pictures with a second light that has this share of the first's or more are left "
                 "out: a reflection, 0-1")
      ->capture_default_str()
      ->check(CLI::Range(0.0, 1.0).description(""))
      ->group(group);
  app.add_option("--points", o.max_points,
                 "At most so many of the light's places (default: 300), instants of the board (80) "
                 "or points of the scene (3000) are used")
      ->check(CLI::Range(20, 100000).description(""))
      ->group(group);
  app.add_flag("--trust-clocks", o.trust_clocks,
               "Take frame times as they are: by default each camera's clock is set by the light's "
               "motion, too")
      ->group(group);
  app.add_option("--detections", o.detections,
                 "Write where the light was seen: this table, and its cameras beside it as "
                 "FILE.cameras.json")
      ->type_name("FILE.csv")
      ->group(group);
}

void add_features(CLI::App& app, GeometryOptions& o) {
  const char* group = "The scene itself, in a take";
  auto* features = app.add_flag("--features", o.features,
                                "Find points of a scene that stands still instead of a light: to "
                                "refine a rig (--start) that moved a little")
                       ->group(group);
  app.add_option("--at", o.at_s,
                 "Time of the frames that are looked at, s since the take's epoch (default: the "
                 "middle of the take)")
      ->needs(features)
      ->check(CLI::Range(-1e7, 1e7).description(""))
      ->group(group);
}

void add_model(CLI::App& app, GeometryOptions& o) {
  const char* group = "What is found";
  app.add_flag(
         "--lens-per-camera", o.lens_per_camera,
         "Each camera has a lens of its own (default: one for all, unless --lens or --start give "
         "each its own)")
      ->group(group);
  app.add_flag("--whole-lens-model", o.full_lens_model,
               "Also k3, tangential distortion and pixels that are not square (default: focal "
               "length, principal point, k1, k2)")
      ->group(group);
  app.add_option("--max-rms", o.max_rms_px, "Largest accepted reprojection error, pixels RMS")
      ->capture_default_str()
      ->check(CLI::Range(1e-3, 1e3).description(""))
      ->group(group);
  app.add_flag("--force", o.force, "Write the rig even if the calibration is rejected")
      ->group(group);
}

}  // namespace

CalibrateCommand declare_calibrate_geometry(CLI::App& calibrate) {
  auto options = std::make_shared<GeometryOptions>();
  CLI::App* app = calibrate.add_subcommand(
      "geometry", "Where the cameras stand and look, and their lenses, from a moving light");
  add_inputs(*app, *options);
  add_knowledge(*app, *options);
  add_light(*app, *options);
  add_board_options(*app, options->board);
  add_features(*app, *options);
  add_model(*app, *options);
  app->add_option("--report", options->report, "Write a page with charts of everything found")
      ->type_name("FILE.html");
  add_threads_option(*app, options->threads);
  app->add_flag("--json", options->json, "Print everything found as JSON");
  app->add_flag("-q,--quiet", options->quiet, "No progress on stderr");
  return {app,
          [options](const std::stop_token& stop) { return calibrate_geometry(*options, stop); }};
}

}  // namespace raystage
