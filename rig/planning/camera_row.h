// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "rig/planning/effective_resolution.h"
#include "rig/rig.h"

namespace raystage::rig {

/// An axis of an array.
enum class ArrayAxis { kHorizontal, kVertical };

/// What the cameras of a rig sample along an axis, measured from their poses and intrinsics. Lens
/// distortion is left out.
struct ArraySampling {
  CameraRow row;            ///< focal length 1; mean pixel pitch and field of view of the cameras
  int pixels = 0;           ///< of a camera along the axis; the most of any camera
  double width = 0;         ///< between the outermost cameras, metres
  double max_rotation = 0;  ///< of a camera's axis against the array's, radians
  /// Smallest and largest distance of two adjacent pixels' rays on a plane at distance 1 that is
  /// parallel to the array. Rotated cameras sample it unevenly (thesis 5.4, figure 5-31).
  double finest_step = 0, coarsest_step = 0;
  bool is_skewed =
      false;  ///< parallel cameras whose frusta coincide on a plane at a finite distance
};

/// Measures an array. `spacing`: the largest distance of neighbours (max_neighbour_baseline()).
/// Throws Error (bad input) for a rig without cameras.
ArraySampling measure_sampling(const Rig& rig, ArrayAxis axis);

}  // namespace raystage::rig
