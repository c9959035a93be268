// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "rig/rig.h"
#include "rig/topology.h"
#include "schemas/geometry.h"

namespace raystage::rig {

/// Returns the difference of disparity, in pixels, between the nearest and the farthest point of a
/// scene for two cameras: `focal_length` (pixels) * `spacing` (metres) * (1/near - 1/far).
double disparity_range(double focal_length, double spacing, schemas::DepthRange range);

/// The largest disparity range between neighbouring cameras, in pixels, at which the optimal focal
/// plane (thesis eq. 2.2) has no ghosting (eq. 2.1): every error is at most one pixel.
inline constexpr double kMaxAliasFreeDisparity = 2;

/// Returns the largest camera spacing, in metres, at which one focal plane has no ghosting (eq.
/// 2.1); infinity for a scene without depth range. `focal_length` is in pixels.
double max_alias_free_baseline(double focal_length, schemas::DepthRange range);

/// Returns the number of focal planes, at least 1, that avoid ghosting for a disparity range
/// between neighbouring cameras, in pixels. Each plane covers kMaxAliasFreeDisparity.
double alias_free_plane_count(double disparity_range);

/// Returns the range of depths without ghosting for a focal plane at `focal_depth`, in metres: one
/// pixel of disparity on each side. The far end may be infinite. If `spacing` is 0, the range
/// contains all depths.
schemas::DepthRange alias_free_depth_range(double focal_length, double spacing, double focal_depth);

/// Returns the largest distance of neighbouring cameras of the array, in metres; 0 for a single
/// centre. It is the maximum over cells of the second longest side, because a grid cell's longest
/// side is the diagonal.
double max_neighbour_baseline(const Rig& rig, const Topology& topology);

}  // namespace raystage::rig
