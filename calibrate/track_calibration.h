// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "calibrate/detect/point_tracks.h"
#include "calibrate/geometry/calibration.h"

namespace raystage {

/// What was followed through a take: a light, or a board's corners.
struct RecordedTracks {
  PointTracks tracks;
  std::vector<DetectionsDocument::Camera> cameras;
  Nanoseconds period = 0;  ///< between frames
};

struct TrackCalibrationSettings {
  TrackInterpolationSettings points;
  CalibrationSettings calibration;
  bool estimates_clock_offsets = true;  ///< false: times are taken as they are
};

struct TrackCalibration {
  InterpolatedTracks points;  ///< with the clocks set
  Calibration calibration;
  /// How far each camera's times are ahead of the others', ns, mean 0; 0 where nothing tells.
  std::vector<Nanoseconds> clock_offsets;
};

/// Calibrates an array, and its clocks with it: a camera whose times are ahead by d sees a light
/// that moves at v (pixels per second) v d behind where the others say it is. After each solve d
/// follows from all of a camera's points, and times are set by it, until none moves by a fiftieth
/// of a pixel's time. Throws Error as calibrate() does.
TrackCalibration calibrate_from_tracks(const RecordedTracks& light,
                                       const TrackCalibrationSettings& settings);

/// "Clocks     set by up to 4.3 ms".
std::string format_clock_offsets(const TrackCalibration& found,
                                 const std::vector<DetectionsDocument::Camera>& cameras);

}  // namespace raystage
