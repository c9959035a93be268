// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <functional>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "base/time.h"
#include "calibrate/detect/light_spot.h"
#include "calibrate/geometry/detections.h"
#include "store/take.h"

namespace raystage {

/// The track of one target in one camera: a light, or an identifiable corner of a board.
struct PointTrack {
  struct FrameDetection {
    Nanoseconds time = 0;  ///< of the frame, in the array's common time
    LightSpot spot;
  };
  std::vector<FrameDetection> frame_detections;  ///< of every frame, by increasing time
  std::array<int, kLightDetectionStatusCount> frame_counts{};  ///< by LightDetectionStatus
};

/// Tracks by camera, then by target. All cameras have the same number of targets.
using PointTracks = std::vector<std::vector<PointTrack>>;

/// Returns the times of a take's frames by camera in the array's common time, ns since its epoch;
/// kNoTime for outliers. They come from the take's timeline, or from a resynchronisation if it has
/// none.
std::vector<std::vector<Nanoseconds>> synchronised_frame_times(const Take& take);

/// Returns the track of the light in each camera, from every frame. A spot with less than a tenth
/// of the camera's median light counts as unsteady. Calls `progress` with the share that is done,
/// in [0, 1]. Throws Error (failed) if a stop is requested, (bad input) for a damaged frame.
PointTracks track_light(const Take& take, const std::vector<std::vector<Nanoseconds>>& times,
                        const LightDetectionSettings& settings,
                        const std::function<void(double)>& progress, const std::stop_token& stop);

/// Returns "Light      in 620 of 720 frames; 60 dark, 40 ambiguous", and the cameras with few
/// detections.
std::string format_track_summary(const PointTracks& tracks,
                                 const std::vector<DetectionsDocument::Camera>& cameras);

/// Returns the cameras of a take for a table of detections.
std::vector<DetectionsDocument::Camera> detection_cameras(const Take& take);

/// Returns the median time between consecutive frames, ns; 0 if no camera has two.
Nanoseconds median_frame_period(const std::vector<std::vector<Nanoseconds>>& times);

struct TrackInterpolationSettings {
  int max_points = 300;  ///< instants, spread over the recording
  double min_step_px =
      3;  ///< smallest motion of the light since the last point, median over cameras
  /// Uses only the half of the instants at which targets move least: for boards, which can be held
  /// still, and cameras with inexact times.
  bool prefers_still_instants = false;
  double max_curvature_px = 4;  ///< largest distance between linear and cubic interpolation
};

/// Detections at common times.
struct InterpolatedTracks {
  Detections detections;              ///< numbered tick * targets + target
  int targets = 1;                    ///< number per instant
  Nanoseconds begin = 0, period = 0;  ///< time of tick 0; from tick to tick, ns
};

/// Interpolates the tracks of free-running cameras at common times: a cubic through two detections
/// on each side, a parabola if one side has only one, nothing if both have one. `period`: between
/// frames, ns; longer gaps are not interpolated.
InterpolatedTracks interpolate_tracks(const PointTracks& tracks,
                                      const std::vector<DetectionsDocument::Camera>& cameras,
                                      Nanoseconds period,
                                      const TrackInterpolationSettings& settings);

/// Returns the velocity of a target in the picture, pixels per second; none where
/// interpolate_tracks() has no position.
std::optional<Eigen::Vector2d> track_velocity(const PointTrack& track, Nanoseconds time,
                                              Nanoseconds period);

}  // namespace raystage
