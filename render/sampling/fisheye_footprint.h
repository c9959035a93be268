// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <span>

#include "render/sampling/source_view.h"

namespace raystage::render {

/// Returns the frame position in pixels of a direction (x right, y down, z ahead, any length)
/// through a fisheye's fit, also beyond its largest angle, where it is continued at that angle.
Eigen::Vector2d fisheye_position(const SourceView& source, const Eigen::Vector3d& direction);

/// The box in a fisheye's frame that holds all directions between some others.
struct FisheyeFootprint {
  enum class Place {
    kUnseen,  ///< all are beyond the largest angle
    kSeen,    ///< `left` to `bottom` bound what is seen
    kUnclear  ///< the directions are too far apart for a bound
  } place = Place::kUnclear;
  double left = 0, right = 0, top = 0, bottom = 0;  ///< pixels; not limited to the frame
  double margin = 0;         ///< pixels of the box beyond the positions of the corners
  bool is_at_limit = false;  ///< some are beyond the largest angle: the box may be much too large
};

/// Bounds the positions of all positive combinations of `corners` (x right, y down, z ahead, any
/// length but 0). `is_flat`: the corners are those of a convex quadrilateral in order, which bound
/// more tightly than others do.
FisheyeFootprint fisheye_footprint(const SourceView& source,
                                   std::span<const Eigen::Vector3d> corners, bool is_flat);

}  // namespace raystage::render
