// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <stop_token>
#include <string>
#include <vector>

#include "calibrate/geometry/array_model.h"

namespace raystage::calibrate {

struct InitialPosesOptions {
  double max_error_px = 8;  ///< observations with a larger reprojection error are not used
  /// A camera whose observations do not fit its lens may get another focal length, half to twice
  /// the initial one.
  bool estimates_focal_lengths = false;
  std::vector<bool> fixed_cameras = {};  ///< whose poses are held; empty: none
  std::stop_token stop = {};             ///< stops it
  bool is_valid(std::string* reason) const;
};

/// Determines poses and points by incremental structure from motion. It starts with two cameras
/// that share many points in different directions (essential matrix, RANSAC). The other cameras are
/// registered by the known points (perspective-n-point, RANSAC), new points are triangulated, and
/// bundle adjustments of growing size run in between. Lenses are held. Cameras with too few points
/// get no pose. The first camera of the pair is at the origin and looks down -z; the baseline of
/// the pair is 1. Returns whether a pair was found.
bool estimate_initial_poses(ArrayModel& model, const InitialPosesOptions& options);

/// Registers the remaining cameras; poses of at least two cameras and their points must be known.
void register_cameras(ArrayModel& model, const InitialPosesOptions& options);

}  // namespace raystage::calibrate
