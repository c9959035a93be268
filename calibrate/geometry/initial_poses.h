// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <stop_token>
#include <vector>

#include "calibrate/geometry/array_model.h"

namespace raystage {

struct InitialPosesSettings {
  double max_error_px = 8;  ///< an observation farther from where it should be does not count
  /// A camera that does not fit with the lens it has may get another focal length, half to twice
  /// of what was guessed.
  bool estimates_focal_lengths = false;
  std::vector<bool> fixed_cameras = {};  ///< whose poses rest; empty: none's
  std::stop_token stop = {};             ///< asks to end it
};

/// Structure from motion: from two cameras that share many points in directions that differ
/// (essential matrix, RANSAC) to the others, each from the points that are found by then
/// (perspective-n-point, RANSAC), and to the points that two of the found cameras see, with bundle
/// adjustments of ever larger parts in between. Lenses are taken as they are. Cameras that see too
/// few points stay without a pose. The first camera of the pair looks down -z from the origin; the
/// two are 1 apart. Returns whether a pair was found.
bool estimate_initial_poses(ArrayModel& model, const InitialPosesSettings& settings);

/// The second part of it alone: two cameras at least and their points are found.
void register_cameras(ArrayModel& model, const InitialPosesSettings& settings);

/// Places what is not found of the points that at least two found cameras see, where their rays
/// come nearest to each other; not where these are all but parallel.
void triangulate_points(ArrayModel& model, double max_error_px);

}  // namespace raystage
