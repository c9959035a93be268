// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "render/slabs/slab.h"
#include "rig/rig.h"

namespace raystage::render {

/// The cameras from which a node of a slab is made.
struct NodeSources {
  int count = 0;  ///< 0: no camera is near enough
  std::array<int, 3> camera{};
  std::array<double, 3> weight{};  ///< in [0, 1], sum 1
  /// The single camera is at the node's position: its image becomes the node's without a focal
  /// plane.
  bool at_camera = false;
  /// The part of the weight that would be unchanged if no camera were absent.
  double present_weight = 1;
};

/// Returns the sources of every node, row by row. They are the cameras of the cell of `present`
/// that contains the node, projected along the slab's normal, with the node's barycentric weights.
/// Outside of all cells the nearest point of any cell is used, up to one node spacing away. A
/// camera nearer than 1e-4 of the spacing is used alone, which shifts the image by 1e-4 of the
/// disparity between neighbours. `present`, `complete`: of the slab's cameras, with indices into
/// `rig`.
std::vector<NodeSources> node_sources(const Slab& slab, const rig::Rig& rig,
                                      const rig::Topology& present, const rig::Topology& complete);

/// The point of a triangle nearest to a given point, as barycentric weights in [0, 1] with sum 1.
/// Corners may coincide or be collinear.
struct NearestInTriangle {
  std::array<double, 3> weight{};
  double squared_distance = 0;
};
NearestInTriangle nearest_in_triangle(const Eigen::Vector2d& point,
                                      const std::array<Eigen::Vector2d, 3>& corners);

}  // namespace raystage::render
