// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "calibrate/light_tracks.h"
#include "rig/calibration/calibration.h"

namespace raystage {

/// What was followed through a take: a light, or a board's corners.
struct LightRecording {
  Tracks tracks;
  std::vector<DetectionsDocument::Camera> cameras;
  Nanoseconds period = 0;  ///< between frames
};

struct LightCalibrationSettings {
  LightPointSettings points;
  CalibrationSettings calibration;
  bool finds_clocks = true;  ///< false: times are taken as they are
};

struct LightCalibration {
  LightPoints points;  ///< with the clocks set
  Calibration calibration;
  /// How far each camera's times are ahead of the others', ns, mean 0; 0 where nothing tells.
  std::vector<Nanoseconds> clock_offsets;
};

/// Calibrates an array, and its clocks with it: a camera whose times are ahead by d sees a light
/// that moves at v (pixels per second) v d behind where the others say it is. After each solve d
/// follows from all of a camera's points, and times are set by it, until none moves by a fiftieth
/// of a pixel's time. Throws Error as calibrate() does.
LightCalibration calibrate_light(const LightRecording& light,
                                 const LightCalibrationSettings& settings);

/// "Clocks     set by up to 4.3 ms".
std::string clock_text(const LightCalibration& found,
                       const std::vector<DetectionsDocument::Camera>& cameras);

}  // namespace raystage
