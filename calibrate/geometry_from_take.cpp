// SPDX-License-Identifier: Apache-2.0
// Collects the detections of a take (light, board or scene features) and the settings that depend
// on its cameras, for a calibration of the array.
#include "calibrate/geometry_from_take.h"

#include <fmt/format.h>

#include <algorithm>
#include <numbers>
#include <numeric>

#include "base/error.h"
#include "calibrate/detect/board_detection.h"
#include "store/timeline.h"

namespace raystage::calibrate {

namespace {

/// Returns the line times that the rig of a take states.
std::vector<double> known_line_times(const store::Take& take) {
  std::vector<double> line_times_us;
  for (const rig::Rig::Camera& camera : take.rig().cameras) {
    line_times_us.push_back(camera.line_time_us);
  }
  return line_times_us;
}

}  // namespace

RecordedTracks record_light_tracks(const store::Take& take, const LightDetectionOptions& options,
                                   const std::function<void(double)>& progress,
                                   const std::stop_token& stop) {
  const auto times = synchronised_frame_times(take);
  return {track_light(take, times, options, progress, stop), detection_cameras(take),
          median_frame_period(times), known_line_times(take)};
}

RecordedTracks record_board_tracks(const store::Take& take, const BoardDetector& detector,
                                   const std::function<void(double)>& progress,
                                   const std::stop_token& stop) {
  const auto times = synchronised_frame_times(take);
  return {track_board_corners(take, times, detector, progress, stop), detection_cameras(take),
          median_frame_period(times), known_line_times(take)};
}

TrackCalibrationOptions board_calibration_options(const Board& board,
                                                  std::optional<int> max_instants) {
  constexpr int kMaxInstants = 80;
  TrackCalibrationOptions options;
  options.points.max_points = max_instants.value_or(kMaxInstants);
  options.points.prefers_still_instants = true;
  options.points.min_step_px = 0;
  options.points.max_curvature_px = 20;  // frames are close to still instants
  options.calibration.board = board.all_corners();
  return options;
}

Detections match_scene_features(const store::Take& take, std::optional<Nanoseconds> time,
                                const FeatureMatchingOptions& options,
                                const std::function<void(double)>& progress,
                                const std::stop_token& stop) {
  const store::TimeRange all = store::running_range(synchronised_frame_times(take));
  return match_features(take, time.value_or(std::midpoint(all.begin, all.end)),
                        store::default_frame_tolerance(take.document().nominal_fps), options,
                        progress, stop);
}

std::vector<LensModel> recorded_lens_models(const store::Take& take) {
  std::vector<LensModel> models;
  for (const rig::Rig::Camera& camera : take.rig().cameras) {
    const schemas::Intrinsics& lens = camera.model.intrinsics();
    models.push_back({lens.projection, lens.half_angle});
  }
  return models;
}

std::vector<schemas::Intrinsics> initial_lenses(
    const schemas::RigDocument& rig, const std::filesystem::path& rig_file,
    const std::vector<schemas::DetectionsDocument::Camera>& cameras) {
  std::vector<schemas::Intrinsics> lenses;
  for (const schemas::DetectionsDocument::Camera& camera : cameras) {
    const schemas::RigDocument::Camera* own = rig.find(camera.id);
    if (own == nullptr && rig.cameras.size() != 1) {
      throw Error::bad_input(
          "there is no lens for camera \"" + camera.id + "\"", rig_file.string(),
          "Give a rig with all cameras, or with one camera whose lens is used for all");
    }
    const schemas::CameraGeometry& geometry =
        own == nullptr ? rig.cameras.front().geometry : own->geometry;
    if (geometry.width != camera.width || geometry.height != camera.height) {
      throw Error::bad_input(
          fmt::format("the lens is for pictures of {}x{}, camera \"{}\" has {}x{}", geometry.width,
                      geometry.height, camera.id, camera.width, camera.height),
          rig_file.string(), "Measure the lens at the frame size that is recorded");
    }
    lenses.push_back(geometry.intrinsics);
  }
  return lenses;
}

std::vector<schemas::Intrinsics> known_lenses(
    const CalibrationOptions& options,
    const std::vector<schemas::DetectionsDocument::Camera>& cameras) {
  if (!options.start) return options.solve.lenses;
  return initial_lenses(*options.start, "the initial rig", cameras);
}

void check_calibration_options(const CalibrationOptions& options,
                               const std::vector<schemas::DetectionsDocument::Camera>& cameras) {
  if (options.solve.lens_is_known && options.solve.lenses.empty() && !options.start) {
    throw Error::bad_input("the lens is to be held, but no lens is given",
                           "the calibration settings",
                           "Give a lens (`raystage calibrate lens`), or a rig to start from")
        .concerning({"lens", "initial_rig"});
  }
  constexpr double kWidestPinhole = 160 * std::numbers::pi / 180;
  const std::vector<LensModel>& models = options.solve.lens_models;
  const auto is_pinhole = [](const LensModel& model) {
    return model.projection == schemas::Projection::kPinhole;
  };
  if (options.solve.horizontal_fov.value_or(0) > kWidestPinhole &&
      (models.empty() || std::ranges::any_of(models, is_pinhole))) {
    throw Error::bad_input("the field of view is above 160 degrees, but a lens is a pinhole",
                           "the calibration settings",
                           "Give a smaller field of view, or the model of a fisheye")
        .concerning({"fov_deg", "lens_model"});
  }
  std::vector<std::string> named = options.fixed_cameras;
  if (options.scale.distance) {
    named.insert(named.end(), {options.scale.distance->from, options.scale.distance->to});
  }
  for (const std::string& id : named) {
    if (std::ranges::find(cameras, id, &schemas::DetectionsDocument::Camera::id) != cameras.end())
      continue;
    throw Error::bad_input("there is no camera \"" + id + "\"", "the calibration settings",
                           "Name cameras that are calibrated")
        .concerning({"fix", "distance"});
  }
}

}  // namespace raystage::calibrate
