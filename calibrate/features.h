// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <stop_token>

#include "rig/calibration/detections.h"
#include "schemas/time.h"
#include "store/take.h"

namespace raystage {

struct FeatureSettings {
  int most_features = 3000;  ///< of a picture, the strongest
  double most_ratio = 0.75;  ///< nearest match by second nearest (Lowe 2004, section 7.1)
  double most_px = 2;        ///< from the epipolar line of a match
  int least_cameras = 3;     ///< that see a point; 2 where there are no more
  int most_points = 3000;    ///< those that most cameras see
};

/// Points of the scene itself, which need no light and no board: features (SIFT) of every camera's
/// frame nearest to a time, matched between all pairs of cameras both ways, held to the pair's
/// epipolar geometry, and joined to points; a point that would be at two places of one picture is
/// left out. What moves must not: cameras' times differ. Progress and errors as track_light(); (bad
/// input) where fewer than two cameras have a frame within `tolerance` of the time.
Detections feature_points(const Take& take, Nanoseconds time, Nanoseconds tolerance,
                          const FeatureSettings& settings,
                          const std::function<void(double)>& progress, const std::stop_token& stop);

}  // namespace raystage
