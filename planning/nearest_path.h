// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <string>

#include "compose/shot_plan.h"
#include "schemas/shot_document.h"

namespace raystage::planning {

/// A path of the camera along which every ray was recorded.
struct NearestPath {
  schemas::ShotDocument shot;  ///< the given one with a key of the camera for each frame
  double largest_shift = 0;    ///< of the camera against the given path, metres
  int largest_shift_frame = 0;
};

/// Returns the shot with its camera moved into the range of motion of the takes (thesis 5.2). Its
/// orientation and lens stay. Every position is in the range; shifts are as small and change as
/// smoothly from frame to frame as that permits. The camera's keys, file, orbit and dolly zoom
/// become a key for each frame of the shot. Throws Error (bad input) where no array has a known
/// range of motion, or at a frame no position has the view.
NearestPath find_nearest_path(const compose::ShotPlan& plan, const std::string& name,
                              std::span<const compose::PlannedFrame> frames);

}  // namespace raystage::planning
