// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <cmath>
#include <filesystem>
#include <memory>
#include <numbers>
#include <optional>
#include <string>
#include <vector>

#include "base/atomic_file.h"
#include "calibrate/geometry/calibration.h"
#include "calibrate/geometry/calibration_report.h"
#include "calibrate/geometry_from_take.h"
#include "cli/board_options.h"
#include "cli/calibrate.h"
#include "cli/threads.h"

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

CalibrationSettings calibration_settings(const GeometryOptions& options,
                                         const std::vector<DetectionsDocument::Camera>& cameras,
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
  if (!options.lens.empty()) {
    settings.solve.lenses = initial_lenses(read_rig(options.lens), options.lens, cameras);
  }
  for (const std::string& held : options.hold) {
    if (held == "lens") {
      settings.solve.lens_is_known = true;
    } else if (held == "poses") {
      settings.fixes_all_poses = true;
    } else {
      settings.fixed_cameras.push_back(held);
    }
  }
  check_calibration_settings(settings, cameras);
  return settings;
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

struct GeometryResult {
  CalibrationSettings settings;
  Calibration calibration;
};

GeometryResult calibrate_tracks(const RecordedTracks& tracks, TrackCalibrationSettings settings,
                                const GeometryOptions& options) {
  settings.estimates_clock_offsets = !options.trust_clocks;
  const TrackCalibration found = calibrate_from_tracks(tracks, settings);
  if (!options.detections.empty()) write_tracked(found.points.detections, options.detections);
  if (!options.json && settings.estimates_clock_offsets) {
    fmt::print("{}", format_clock_offsets(found, tracks.cameras));
  }
  return {settings.calibration, found.calibration};
}

GeometryResult calibrate_with_light(const GeometryOptions& options, const std::stop_token& stop) {
  const Take take(options.input);
  TrackCalibrationSettings settings;
  settings.points.max_points = options.max_points.value_or(settings.points.max_points);
  settings.calibration = calibration_settings(options, detection_cameras(take), stop);
  Progress progress(!options.quiet);
  const RecordedTracks tracks = record_light_tracks(
      take, options.light, [&](double done) { progress.report(done); }, stop);
  if (!options.json) fmt::print("{}", format_track_summary(tracks.tracks, tracks.cameras));
  return calibrate_tracks(tracks, settings, options);
}

GeometryResult calibrate_with_board(const GeometryOptions& options, const std::stop_token& stop) {
  const BoardDetector detector(make_board(options.board, true));
  const Take take(options.input);
  TrackCalibrationSettings settings =
      board_calibration_settings(detector.board(), options.max_points);
  const BoardObjectPoints corners = settings.calibration.board;
  settings.calibration = calibration_settings(options, detection_cameras(take), stop);
  settings.calibration.board = corners;
  Progress progress(!options.quiet);
  return calibrate_tracks(record_board_tracks(
                              take, detector, [&](double done) { progress.report(done); }, stop),
                          settings, options);
}

GeometryResult calibrate_with_features(const GeometryOptions& options,
                                       const std::stop_token& stop) {
  const Take take(options.input);
  const CalibrationSettings settings = calibration_settings(options, detection_cameras(take), stop);
  FeatureMatchingSettings features;
  features.max_points = options.max_points.value_or(features.max_points);
  std::optional<Nanoseconds> time;
  if (options.at_s) time = static_cast<Nanoseconds>(std::llround(*options.at_s * 1e9));
  Progress progress(!options.quiet);
  const Detections detections = match_scene_features(
      take, time, features, [&](double done) { progress.report(done); }, stop);
  if (!options.detections.empty()) write_tracked(detections, options.detections);
  return {settings, calibrate(detections, settings)};
}

GeometryResult calibrate_table(const GeometryOptions& options, const std::stop_token& stop) {
  const Detections detections = table_of(options);
  const CalibrationSettings settings = calibration_settings(options, detections.cameras, stop);
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
    throw Error::bad_input("--board needs a take, and this is no take", options.input.string(),
                           "Give the take that shows the board, or leave --board out");
  }
  if (options.features && (has_board || !is_take)) {
    throw Error::bad_input("--features needs a take, and excludes --board", "--features",
                           "Give a take of a scene that does not move, and no --board");
  }
  const auto [settings, calibration] = options.features ? calibrate_with_features(options, stop)
                                       : has_board      ? calibrate_with_board(options, stop)
                                       : is_take        ? calibrate_with_light(options, stop)
                                                        : calibrate_table(options, stop);
  fmt::print("{}", options.json ? calibration_report_json(calibration)
                                : format_calibration_report(calibration));
  if (!options.report.empty()) {
    write_file_atomically(options.report,
                          calibration_report_html(calibration, options.output.string()));
  }
  const bool is_sure = calibration.verdict.is_accepted();
  if (!is_sure && !options.force) {
    throw Error::failed("the rig was not written: the calibration was rejected (see \"Rejected\")",
                        options.output.string(),
                        "Follow the advice under \"Next\", or use --force to write it anyway");
  }
  write_rig(make_rig_document(calibration, settings.start, options.name), options.output);
  return ExitCode::kSuccess;
}

void add_inputs(CLI::App& app, GeometryOptions& o) {
  app.add_option(
         "INPUT", o.input,
         "A take of a small light that moves in the dark; with --board, of a board that several "
         "cameras see at once; with --features, of a scene that does not move; or a table of "
         "detections, camera,frame,u,v (docs/formats/documents.md#detections)")
      ->required()
      ->type_name("TAKE|FILE.csv");
  app.add_option("--cameras", o.cameras,
                 "The document with the table's cameras (default: cameras.json in its folder)")
      ->type_name("FILE.json");
  app.add_option("-o,--output", o.output, "The rig to write")->required()->type_name("RIG.json");
  app.add_option("--name", o.name, "Name of the rig")->default_val("calibrated array");
}

void add_knowledge(CLI::App& app, GeometryOptions& o) {
  const char* group = "Known values";
  app.add_option("--spacing-mm", o.spacing_mm,
                 "Distance between adjacent cameras, millimetres: sets the scale")
      ->check(CLI::Range(1e-3, 1e7).description(""))
      ->group(group);
  app.add_option("--distance", o.distance,
                 "Measured distance between the lenses of two cameras, metres: sets the scale")
      ->expected(3)
      ->type_name("ID ID METRES")
      ->excludes("--spacing-mm")
      ->group(group);
  app.add_option(
         "--fov-deg", o.fov_deg,
         "Initial horizontal field of view of all cameras, degrees (default: several are tried)")
      ->check(CLI::Range(2.0, 160.0).description(""))
      ->group(group);
  app.add_option(
         "--lens", o.lens,
         "Initial lenses: a rig with one camera (its lens is used for all) or with all of them")
      ->type_name("RIG.json")
      ->group(group);
  app.add_option("--initial-rig", o.start,
                 "Initial rig to refine: lenses, poses, scale and world frame")
      ->type_name("RIG.json")
      ->excludes("--lens")
      ->group(group);
  app.add_option(
         "--fix", o.hold,
         "Keeps fixed: 'lens' (all lenses), 'poses' (all poses) or a camera's id (its pose); "
         "may be repeated")
      ->allow_extra_args(false)
      ->type_name("WHAT")
      ->group(group);
}

void add_light(CLI::App& app, GeometryOptions& o) {
  const char* group = "Light in a take";
  app.add_option("--light-threshold", o.light.min_light,
                 "Minimum brightness of the light above the background, linear, full scale 1")
      ->capture_default_str()
      ->check(CLI::Range(0.001, 1.0).description(""))
      ->group(group);
  app.add_option("--ambiguity-ratio", o.light.ambiguity_ratio,
                 "Rejects pictures whose second brightest spot (a reflection) has at least this "
                 "fraction of the light's brightness, 0-1")
      ->capture_default_str()
      ->check(CLI::Range(0.0, 1.0).description(""))
      ->group(group);
  app.add_option("--max-points", o.max_points,
                 "Maximum number of light positions (default: 300), instants of the board (80) or "
                 "points of the scene (3000)")
      ->check(CLI::Range(20, 100000).description(""))
      ->group(group);
  app.add_flag(
         "--no-clock-estimation", o.trust_clocks,
         "Use frame times unchanged; by default each camera's clock offset is estimated from the "
         "motion")
      ->group(group);
  app.add_option(
         "--detections", o.detections,
         "Write the detections to this table, and its cameras to FILE.cameras.json in the same "
         "folder")
      ->type_name("FILE.csv")
      ->group(group);
}

void add_features(CLI::App& app, GeometryOptions& o) {
  const char* group = "Features of the scene, in a take";
  auto* features = app.add_flag("--features", o.features,
                                "Match features of a scene that does not move instead of a light: "
                                "to refine a rig (--initial-rig) that moved a little")
                       ->group(group);
  app.add_option(
         "--time", o.at_s,
         "Time of the frames to match, seconds since the take's epoch (default: the middle of "
         "the take)")
      ->needs(features)
      ->check(CLI::Range(-1e7, 1e7).description(""))
      ->group(group);
}

void add_model(CLI::App& app, GeometryOptions& o) {
  const char* group = "Model";
  app.add_flag("--lens-per-camera", o.lens_per_camera,
               "Estimate a lens for each camera (default: one for all, unless --lens or "
               "--initial-rig give "
               "one for each)")
      ->group(group);
  app.add_flag("--full-lens-model", o.full_lens_model,
               "Also k3, tangential distortion and pixels that are not square (default: focal "
               "length, principal point, k1, k2)")
      ->group(group);
  app.add_option("--max-rms-px", o.max_rms_px, "Largest accepted reprojection error, pixels RMS")
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
      "geometry",
      "Estimate the poses and lenses of the cameras from a moving light, a board or features");
  add_inputs(*app, *options);
  add_knowledge(*app, *options);
  add_light(*app, *options);
  add_board_options(*app, options->board);
  add_features(*app, *options);
  add_model(*app, *options);
  app->add_option("--report", options->report, "Write an HTML page with charts of the results")
      ->type_name("FILE.html");
  add_threads_option(*app, options->threads);
  app->add_flag("--json", options->json, "Print the results as JSON");
  app->add_flag("-q,--quiet", options->quiet, "No progress on stderr");
  return {app,
          [options](const std::stop_token& stop) { return calibrate_geometry(*options, stop); }};
}

}  // namespace raystage
