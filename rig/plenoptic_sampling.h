// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "rig/rig.h"
#include "rig/topology.h"
#include "schemas/geometry.h"

namespace raystage {

/// How far apart, in pixels, two cameras see the nearest and the farthest point of a scene relative
/// to each other: `focal_length` (pixels) * `spacing` (metres) * (1/near - 1/far).
double disparity_range(double focal_length, double spacing, DepthRange range);

/// Eq. 2.1: up to this disparity range between neighbouring cameras, pixels, the best single focal
/// plane (eq. 2.2) is free of ghosts: nothing is more than a pixel off.
inline constexpr double kMaxAliasFreeDisparity = 2;

/// Eq. 2.1: the largest spacing of cameras, metres, at which one plane is free of ghosts; infinite
/// for a scene without depth. `focal_length` in pixels.
double max_alias_free_baseline(double focal_length, DepthRange range);

/// Focal planes that free a disparity range between neighbouring cameras, pixels, of ghosts: each
/// does for kMaxAliasFreeDisparity; at least 1.
double alias_free_plane_count(double disparity_range);

/// The depths that a focal plane at `focal_depth` frees of ghosts: a pixel of disparity either way.
/// Metres, may be infinite; everything where `spacing` is 0.
DepthRange alias_free_depth_range(double focal_length, double spacing, double focal_depth);

/// How far apart neighbouring cameras of the array are at most, metres: the widest cell's second
/// longest side (in a grid the longest is the diagonal); 0 for a single centre.
double max_neighbour_baseline(const Rig& rig, const Topology& topology);

}  // namespace raystage
