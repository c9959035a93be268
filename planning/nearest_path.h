// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <stop_token>
#include <string>
#include <vector>

#include "compose/shot_plan.h"
#include "schemas/shot_document.h"

namespace raystage::planning {

/// A path of the camera along which every ray was recorded.
struct NearestPath {
  schemas::ShotDocument shot;  ///< the given one with a key of the camera for each frame
  double largest_shift = 0;    ///< of the camera against the given path, metres
  int largest_shift_frame = 0;
  /// Takes whose range of motion is not known, and why, for people. They do not limit the path.
  std::vector<std::string> ignored_takes;
};

/// Returns the shot with its camera moved into the range of motion of the takes that are visible at
/// each frame (thesis 5.2); of takes around a volume into that of one. Orientation and lens stay.
/// Every position is in the ranges of the complete arrays; shifts are small, and change smoothly
/// from frame to frame as far as that permits. The camera's keys, file, orbit and dolly zoom become
/// a key for each frame of the shot. Throws Error (bad input) where no range is known, or at a
/// frame no position has the view, and Error (failed) if stopped.
NearestPath find_nearest_path(const compose::ShotPlan& plan, const std::string& name,
                              const std::stop_token& stop = {});

}  // namespace raystage::planning
