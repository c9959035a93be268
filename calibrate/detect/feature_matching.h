// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <stop_token>
#include <string>

#include "base/time.h"
#include "calibrate/geometry/detections.h"
#include "store/take.h"

namespace raystage::calibrate {

struct FeatureMatchingOptions {
  int max_features = 3000;  ///< of a picture, the strongest
  /// largest ratio of the nearest to the second nearest distance (Lowe 2004, section 7.1)
  double max_ratio = 0.75;
  double max_epipolar_error_px = 2;  ///< largest distance of a match from its epipolar line
  /// Lens of each camera of the take, for fisheyes; empty: those of the take's rig.
  std::vector<schemas::Intrinsics> lenses = {};
  /// smallest number that observe a point; 2 if the take has only two
  int min_cameras = 3;
  int max_points = 3000;  ///< those with the most cameras
  bool is_valid(std::string* reason) const;
};

/// Returns points of the scene, without a light or a board. SIFT features of each camera's frame
/// nearest to a time are matched between all pairs of cameras in both directions. Matches are
/// filtered by the epipolar geometry of the pair (with a fisheye: of its rays) and joined to
/// points. Points with two positions in one picture are removed. The scene must not move, because
/// the cameras' times differ. Progress and errors as track_light(); also Error (bad input) if fewer
/// than two cameras have a frame within `tolerance` of the time.
Detections match_features(const store::Take& take, Nanoseconds time, Nanoseconds tolerance,
                          const FeatureMatchingOptions& options,
                          const std::function<void(double)>& progress, const std::stop_token& stop);

}  // namespace raystage::calibrate
