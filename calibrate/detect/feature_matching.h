// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <stop_token>

#include "base/time.h"
#include "calibrate/geometry/detections.h"
#include "store/take.h"

namespace raystage {

struct FeatureMatchingSettings {
  int max_features = 3000;           ///< of a picture, the strongest
  double max_ratio = 0.75;           ///< nearest match by second nearest (Lowe 2004, section 7.1)
  double max_epipolar_error_px = 2;  ///< from the epipolar line of a match
  int min_cameras = 3;               ///< that see a point; 2 where there are no more
  int max_points = 3000;             ///< those that most cameras see
};

/// Points of the scene itself, which need no light and no board: features (SIFT) of every camera's
/// frame nearest to a time, matched between all pairs of cameras both ways, held to the pair's
/// epipolar geometry, and joined to points; a point that would be at two places of one picture is
/// left out. What moves must not: cameras' times differ. Progress and errors as track_light(); (bad
/// input) where fewer than two cameras have a frame within `tolerance` of the time.
Detections match_features(const Take& take, Nanoseconds time, Nanoseconds tolerance,
                          const FeatureMatchingSettings& settings,
                          const std::function<void(double)>& progress, const std::stop_token& stop);

}  // namespace raystage
