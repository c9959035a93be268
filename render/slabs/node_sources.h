// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "render/slabs/slab.h"
#include "rig/rig.h"

namespace raystage {

/// The cameras that a node of a slab is made of.
struct NodeSources {
  int count = 0;  ///< 0: none is near enough
  std::array<int, 3> camera{};
  std::array<double, 3> weight{};  ///< in [0, 1], sum 1
  /// The one camera stands where the node is: its image needs no focal plane to become the node's.
  bool at_camera = false;
  /// The part of the weight that would be the same if no camera were absent.
  double present_weight = 1;
};

/// For every node, row by row: the cell of `present` that it lies in, seen along the slab's normal,
/// and its barycentric weights there; outside of all cells those of the nearest point of any, up to
/// one node spacing away. A camera nearer than 1e-4 of the spacing is taken alone: what that shifts
/// is 1e-4 of the disparity between neighbours.
/// `present`, `complete`: of the slab's cameras, with indices into `rig`.
std::vector<NodeSources> node_sources(const Slab& slab, const Rig& rig, const Topology& present,
                                      const Topology& complete);

/// Weights of the corners of the triangle nearest to `point`, and of which point of it:
/// barycentric, in [0, 1], sum 1. Corners may coincide or lie on a line.
struct NearestInTriangle {
  std::array<double, 3> weight{};
  double squared_distance = 0;
};
NearestInTriangle nearest_in_triangle(const Eigen::Vector2d& point,
                                      const std::array<Eigen::Vector2d, 3>& corners);

}  // namespace raystage
