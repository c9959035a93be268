// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "calibrate/detect/point_tracks.h"

namespace raystage::calibrate {

struct TrackInterpolationOptions {
  int max_points = 300;    ///< instants, spread over the recording
  double min_step_px = 3;  ///< smallest motion of the light between points, median over cameras
  /// Uses only the half of the instants at which targets move least: for boards, which can be held
  /// still, and cameras with inexact times.
  bool prefers_still_instants = false;
  double max_curvature_px = 4;  ///< largest distance between linear and cubic interpolation
  bool is_valid(std::string* reason) const;
};

/// Detections interpolated at common times.
struct InterpolatedTracks {
  Detections detections;              ///< numbered tick * targets + target
  int targets = 1;                    ///< number per instant
  Nanoseconds begin = 0, period = 0;  ///< time of tick 0; from tick to tick, ns
};

/// Interpolates the tracks of free-running cameras at common times. The polynomial is a cubic
/// through two detections on each side, or a parabola if one side has only one. If both sides have
/// only one there is no result. `period`: between frames, ns; longer gaps are not interpolated.
InterpolatedTracks interpolate_tracks(
    const PointTracks& tracks, const std::vector<schemas::DetectionsDocument::Camera>& cameras,
    Nanoseconds period, const TrackInterpolationOptions& options);

/// Returns the velocity of a target in the picture, pixels per second; none where
/// interpolate_tracks() has no position.
std::optional<Eigen::Vector2d> track_velocity(const PointTrack& track, Nanoseconds time,
                                              Nanoseconds period);

}  // namespace raystage::calibrate
