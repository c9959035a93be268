// SPDX-License-Identifier: Apache-2.0
// raystage calibrate geometry: estimates the poses and lenses of the cameras.
#include <fmt/format.h>

#include <cmath>
#include <filesystem>
#include <memory>
#include <numbers>
#include <optional>
#include <string>
#include <vector>

#include "base/atomic_file.h"
#include "calibrate/array_lens_models.h"
#include "calibrate/geometry/calibration.h"
#include "calibrate/geometry/calibration_report.h"
#include "calibrate/geometry_from_take.h"
#include "cli/board_options.h"
#include "cli/calibrate.h"
#include "cli/follow_links_option.h"
#include "cli/lens_model_option.h"
#include "cli/printing.h"
#include "cli/take_event.h"
#include "cli/threads.h"

namespace raystage::cli {
namespace {

struct GeometryOptions {
  std::filesystem::path input, cameras, output, start, lens, report, detections;
  std::vector<std::string> hold, distance;
  std::string name = "calibrated array";
  std::optional<double> fov_deg, spacing_mm;
  double max_rms_px = 1;
  bool lens_per_camera = false, full_lens_model = false;
  std::optional<double> at_s;
  bool features = false, trust_clocks = false, keep_line_times = false, force = false, json = false,
       quiet = false;
  int threads = 0;
  std::optional<int> max_points;
  calibrate::LightDetectionOptions light;
  BoardOptions board;
  LensModelOption lens_model;
};

calibrate::ScaleOptions scale_of(const GeometryOptions& options) {
  calibrate::ScaleOptions scale;
  if (options.spacing_mm) scale.spacing_m = *options.spacing_mm / 1000;
  if (options.distance.empty()) return scale;
  double metres = 0;
  try {
    metres = std::stod(options.distance[2]);
  } catch (const std::exception&) {
  }
  if (!(metres > 0)) {
    throw Error::bad_input("found " + options.distance[2] + ", allowed: metres above 0",
                           "--distance",
                           "Use two camera ids and the distance between their lenses");
  }
  scale.distance = {options.distance[0], options.distance[1], metres};
  return scale;
}

/// `recorded`: lens models that the rig of the take states; empty: none.
calibrate::CalibrationOptions calibration_options(
    const GeometryOptions& options, const std::vector<schemas::DetectionsDocument::Camera>& cameras,
    const std::vector<calibrate::LensModel>& recorded, const std::stop_token& stop) {
  calibrate::CalibrationOptions settings;
  settings.solve.lens_models = recorded;
  const LensModelOption& chosen = options.lens_model;
  if (chosen.choice.projection) {
    settings.solve.lens_models.assign(cameras.size(), {*chosen.choice.projection});
  }
  for (calibrate::LensModel& model : settings.solve.lens_models) {
    if (chosen.half_angle_deg && model.projection != schemas::Projection::kPinhole) {
      model.half_angle = *chosen.half_angle_deg * std::numbers::pi / 180;
    }
  }
  settings.solve.stop = stop;
  if (!options.quiet) {
    settings.solve.on_step = [lines =
                                  std::make_shared<Progress>()](const calibrate::SolveStep& step) {
      lines->say(fmt::format("Solved for {}: {:.3f} px RMS", step.what, step.rms_px));
    };
  }
  settings.scale = scale_of(options);
  settings.limits.max_rms_px = options.max_rms_px;
  settings.solve.lens_per_camera = options.lens_per_camera;
  settings.solve.full_lens_model = options.full_lens_model;
  if (options.fov_deg) settings.solve.horizontal_fov = *options.fov_deg * std::numbers::pi / 180;
  if (!options.start.empty()) settings.start = schemas::read_rig(options.start);
  if (!options.lens.empty()) {
    settings.solve.lenses =
        calibrate::initial_lenses(schemas::read_rig(options.lens), options.lens, cameras);
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
  calibrate::check_calibration_options(settings, cameras);
  return settings;
}

void write_tracked(const calibrate::Detections& detections, const std::filesystem::path& table) {
  calibrate::write_detections(detections, table);
  schemas::write_detections_document(
      {detections.cameras}, std::filesystem::path(table).replace_extension(".cameras.json"));
}

calibrate::Detections table_of(const GeometryOptions& options) {
  const std::filesystem::path cameras =
      options.cameras.empty() ? options.input.parent_path() / "cameras.json" : options.cameras;
  return calibrate::read_detections(options.input, schemas::read_detections_document(cameras));
}

struct GeometryResult {
  calibrate::CalibrationOptions settings;
  calibrate::Calibration calibration;
  std::optional<calibrate::ArrayLensModelComparison> models = {};
};

/// Gives the settings the best lens model, if models are to be compared. `compare`: returns the
/// comparison.
template <class Compare>
std::optional<calibrate::ArrayLensModelComparison> choose_lens_model(
    const GeometryOptions& options, std::size_t cameras, calibrate::CalibrationOptions& settings,
    const Compare& compare) {
  if (!options.lens_model.choice.compares) return std::nullopt;
  settings.solve.lens_models.resize(cameras);
  if (options.lens_model.half_angle_deg) {
    for (calibrate::LensModel& model : settings.solve.lens_models) {
      model.half_angle = *options.lens_model.half_angle_deg * std::numbers::pi / 180;
    }
  }
  calibrate::ArrayLensModelComparison found = compare();
  if (!options.json) print(calibrate::format_array_lens_models(found));
  settings =
      calibrate::with_lens_model(std::move(settings), cameras, found.fits[found.best].projection);
  return found;
}

GeometryResult calibrate_tracks(const calibrate::RecordedTracks& tracks,
                                calibrate::TrackCalibrationOptions settings,
                                const GeometryOptions& options) {
  settings.estimates_clock_offsets = !options.trust_clocks;
  settings.estimates_line_times = !options.keep_line_times;
  std::optional<calibrate::ArrayLensModelComparison> models =
      choose_lens_model(options, tracks.cameras.size(), settings.calibration,
                        [&] { return calibrate::compare_track_lens_models(tracks, settings); });
  const calibrate::TrackCalibration found = calibrate::calibrate_from_tracks(tracks, settings);
  if (!options.detections.empty()) write_tracked(found.points.detections, options.detections);
  if (!options.json && settings.estimates_clock_offsets) {
    print(calibrate::format_clock_offsets(found, tracks.cameras));
  }
  return {settings.calibration, found.calibration, std::move(models)};
}

GeometryResult calibrate_detections(const calibrate::Detections& detections,
                                    calibrate::CalibrationOptions settings,
                                    const GeometryOptions& options) {
  std::optional<calibrate::ArrayLensModelComparison> models =
      choose_lens_model(options, detections.cameras.size(), settings,
                        [&] { return calibrate::compare_array_lens_models(detections, settings); });
  calibrate::Calibration calibration = calibrate::calibrate(detections, settings);
  return {std::move(settings), std::move(calibration), std::move(models)};
}

GeometryResult calibrate_with_light(const GeometryOptions& options, const std::stop_token& stop) {
  const store::Take take(options.input);
  calibrate::TrackCalibrationOptions settings;
  settings.points.max_points = options.max_points.value_or(settings.points.max_points);
  settings.calibration = calibration_options(options, calibrate::detection_cameras(take),
                                             calibrate::recorded_lens_models(take), stop);
  Progress progress(!options.quiet);
  const calibrate::RecordedTracks tracks = calibrate::record_light_tracks(
      take, options.light, [&](double done) { progress.report(done); }, stop);
  if (!options.json) print(calibrate::format_track_summary(tracks.tracks, tracks.cameras));
  return calibrate_tracks(tracks, settings, options);
}

GeometryResult calibrate_with_board(const GeometryOptions& options, const std::stop_token& stop) {
  const calibrate::BoardDetector detector(make_board(options.board, true));
  const store::Take take(options.input);
  calibrate::TrackCalibrationOptions settings =
      calibrate::board_calibration_options(detector.board(), options.max_points);
  const calibrate::BoardObjectPoints corners = settings.calibration.board;
  settings.calibration = calibration_options(options, calibrate::detection_cameras(take),
                                             calibrate::recorded_lens_models(take), stop);
  settings.calibration.board = corners;
  Progress progress(!options.quiet);
  return calibrate_tracks(calibrate::record_board_tracks(
                              take, detector, [&](double done) { progress.report(done); }, stop),
                          settings, options);
}

GeometryResult calibrate_with_features(const GeometryOptions& options,
                                       const std::stop_token& stop) {
  const store::Take take(options.input);
  calibrate::CalibrationOptions settings = calibration_options(
      options, calibrate::detection_cameras(take), calibrate::recorded_lens_models(take), stop);
  calibrate::FeatureMatchingOptions features;
  features.lenses = calibrate::known_lenses(settings, calibrate::detection_cameras(take));
  features.max_points = options.max_points.value_or(features.max_points);
  std::optional<Nanoseconds> time;
  if (options.at_s) time = static_cast<Nanoseconds>(std::llround(*options.at_s * 1e9));
  Progress progress(!options.quiet);
  const calibrate::Detections detections = calibrate::match_scene_features(
      take, time, features, [&](double done) { progress.report(done); }, stop);
  if (!options.detections.empty()) write_tracked(detections, options.detections);
  return calibrate_detections(detections, std::move(settings), options);
}

GeometryResult calibrate_table(const GeometryOptions& options, const std::stop_token& stop) {
  const calibrate::Detections detections = table_of(options);
  return calibrate_detections(detections,
                              calibration_options(options, detections.cameras, {}, stop), options);
}

ExitCode calibrate_geometry(const GeometryOptions& options, const std::stop_token& stop) {
  const ThreadLimit limit(options.threads);
  check_writable(options.output);
  if (!options.report.empty()) check_writable(options.report);
  if (!options.detections.empty()) check_writable(options.detections);
  const bool is_take = is_folder(options.input);
  const bool has_board = !options.board.squares.empty();
  if (has_board && !is_take) {
    throw Error::bad_input("--board needs a take, but this is not a take", options.input.string(),
                           "Use the take that shows the board, or omit --board");
  }
  if (options.features && (has_board || !is_take)) {
    throw Error::bad_input("--features needs a take, and excludes --board", "--features",
                           "Use a take of a scene that does not move, without --board");
  }
  const auto [settings, calibration, models] = options.features
                                                   ? calibrate_with_features(options, stop)
                                               : has_board ? calibrate_with_board(options, stop)
                                               : is_take   ? calibrate_with_light(options, stop)
                                                           : calibrate_table(options, stop);
  if (options.json) {
    const std::string report = calibrate::calibration_report_json(calibration);
    print(models ? calibrate::with_lens_models_json(report, *models) : report);
  } else {
    print(calibrate::format_calibration_report(calibration));
  }
  if (!options.report.empty()) {
    write_file_atomically(options.report,
                          calibrate::calibration_report_html(
                              calibration, options.output.string(),
                              models ? calibrate::lens_models_html(*models) : std::string()));
  }
  const bool is_sure = calibration.verdict.is_accepted();
  if (!is_sure && !options.force) {
    throw Error::failed("the rig was not written: the calibration was rejected (see \"Rejected\")",
                        options.output.string(),
                        "Follow the advice under \"Next\", or use --force to write it anyway");
  }
  schemas::write_rig(calibrate::make_rig_document(calibration, settings.start, options.name),
                     options.output);
  record_rig_event(options.output, "calibrate geometry");
  return ExitCode::kSuccess;
}

void add_inputs(CommandLine& command, GeometryOptions& o) {
  command
      .option("INPUT TAKE|FILE.csv", o.input,
              "A take of a small light that moves in the dark; with --board, of a board that "
              "several cameras see at once; with --features, of a scene that does not move; or a "
              "table of detections, camera,frame,u,v (docs/formats/documents.md#detections)")
      .required();
  command.option("--cameras FILE.json", o.cameras,
                 "The document with the table's cameras (default: cameras.json in its folder)");
  command.option("-o,--output RIG.json", o.output, "The rig to write").required();
  command.option("--name", o.name, "Name of the rig").show_default();
}

void add_knowledge(CommandLine command, GeometryOptions& o) {
  command.option("--spacing-mm", o.spacing_mm, "Distance of adjacent cameras, mm; sets the scale")
      .limits(1e-3, 1e7);
  command
      .option("--distance ID ID METRES", o.distance,
              "Measured distance between the lenses of two cameras, metres: sets the scale")
      .expected(3, 3)
      .excludes("--spacing-mm");
  command
      .option("--fov-deg", o.fov_deg,
              "Initial horizontal field of view of all cameras, degrees, pinholes up to 160 "
              "(default: tries several)")
      .limits(2.0, 300.0);
  command.option(
      "--lens RIG.json", o.lens,
      "Initial lenses: a rig with one camera (its lens is used for all) or with all of them");
  command
      .option("--initial-rig RIG.json", o.start,
              "Initial rig to refine: lenses, poses, scale and world frame")
      .excludes("--lens");
  command
      .option("--fix WHAT", o.hold,
              "Keeps fixed: 'lens' (all lenses), 'poses' (all poses) or a camera's id (its pose); "
              "may be repeated")
      .one_argument();
}

void add_light(CommandLine command, GeometryOptions& o) {
  command
      .option("--light-threshold", o.light.min_light,
              "Minimum brightness of the light above the background, linear, full scale 1")
      .show_default()
      .limits(0.001, 1.0);
  command
      .option("--ambiguity-ratio", o.light.ambiguity_ratio,
              "Rejects pictures whose second brightest spot (a reflection) has at least this "
              "fraction of the light's brightness, 0-1")
      .show_default()
      .limits(0.0, 1.0);
  command
      .option("--max-points", o.max_points,
              "Maximum number of light positions (default: 300), instants of the board (80) or "
              "points of the scene (3000)")
      .limits(20, 100000);
  command.flag("--no-clock-estimation", o.trust_clocks,
               "Use frame times unchanged; by default each camera's clock offset is estimated from "
               "the motion");
  command.flag(
      "--no-line-time-estimation", o.keep_line_times,
      "Take cameras for global shutters unless the rig of the take or --initial-rig states "
      "a line time; by default unknown line times are estimated from the motion");
  command.option("--detections FILE.csv", o.detections,
                 "Write the detections to this table, and its cameras to FILE.cameras.json in the "
                 "same folder");
}

void add_features(CommandLine command, GeometryOptions& o) {
  command.flag("--features", o.features,
               "Match features of a scene that does not move instead of a light: to refine a rig "
               "(--initial-rig) that moved a little");
  command
      .option("--time", o.at_s,
              "Time of the frames to match, seconds since the take's epoch (default: the middle of "
              "the take)")
      .needs("--features")
      .limits(-1e7, 1e7);
}

void add_model(CommandLine command, GeometryOptions& o) {
  add_lens_model_options(
      command, o.lens_model, true,
      "; auto compares them and uses the one with the least error at points that were held out "
      "(default: that of the take's rig, of a table pinhole)")
      .excludes("--lens")
      .excludes("--initial-rig");
  command.flag("--lens-per-camera", o.lens_per_camera,
               "Estimate a lens for each camera (default: one for all, unless --lens or "
               "--initial-rig give one for each)");
  command.flag("--full-lens-model", o.full_lens_model,
               "Also pixels that are not square, and k3 and tangential distortion of pinholes, k3 "
               "and k4 of other lenses (default: focal length, principal point, k1, k2)");
  command.option("--max-rms-px", o.max_rms_px, "Largest accepted reprojection error, pixels RMS")
      .show_default()
      .limits(1e-3, 1e3);
  command.flag("--force", o.force, "Write the rig even if the calibration is rejected");
}

}  // namespace

Subcommand declare_calibrate_geometry(CommandLine& calibrate) {
  auto options = std::make_shared<GeometryOptions>();
  CommandLine command = calibrate.subcommand(
      "geometry",
      "Estimate the poses and lenses of the cameras from a moving light, a board or features");
  add_inputs(command, *options);
  add_knowledge(command.group("Known values"), *options);
  add_light(command.group("Light in a take"), *options);
  add_board_options(command, options->board, false);
  add_features(command.group("Features of the scene, in a take"), *options);
  add_model(command.group("Model"), *options);
  command.option("--report FILE.html", options->report,
                 "Write an HTML page with charts of the results");
  add_threads_option(command, options->threads);
  command.flag("--json", options->json, "Print the results as JSON");
  add_follow_links_option(command);
  command.flag("-q,--quiet", options->quiet, "No progress on stderr");
  return {command,
          [options](const std::stop_token& stop) { return calibrate_geometry(*options, stop); }};
}

}  // namespace raystage::cli
