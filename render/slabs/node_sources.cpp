// SPDX-License-Identifier: Apache-2.0
// Finds the cameras of each node of a slab: the nearest point of the array's cells, projected along
// the slab's normal, and its barycentric weights. Input: slab, camera centres (metres), topology.
// Output: up to 3 cameras per node, weights of sum 1. Cost: O(nodes x cells).
#include "render/slabs/node_sources.h"

#include <algorithm>
#include <limits>

namespace raystage::render {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double kSamePlace = 1e-4;  // of the node spacing

double cross(const Vector2d& a, const Vector2d& b) { return a.x() * b.y() - a.y() * b.x(); }

/// Returns a node's sources in a topology; `centres`: per camera of the rig, in the slab's frame.
NodeSources sources_in(const rig::Topology& topology, const std::vector<Vector3d>& centres,
                       const Vector2d& node, double reach) {
  NodeSources nearest;
  double least = std::numeric_limits<double>::infinity();
  for (const rig::Topology::Cell& cell : topology.cells) {
    // A cell of fewer cameras is a triangle whose last corners coincide.
    std::size_t last = 0;
    std::array<Vector2d, 3> corners;
    for (std::size_t i = 0; i < 3; ++i) {
      if (cell[i] >= 0) last = i;
      corners[i] = centres[cell[last]].head<2>();
    }
    const NearestInTriangle found = nearest_in_triangle(node, corners);
    if (!(found.squared_distance < least)) continue;
    least = found.squared_distance;
    nearest = {};
    std::array<double, 3> weight{};
    for (std::size_t i = 0; i < 3; ++i) weight[std::min(i, last)] += found.weight[i];
    for (std::size_t i = 0; i < 3; ++i) {
      if (weight[i] <= 0) continue;
      const auto place = static_cast<std::size_t>(nearest.count++);
      nearest.camera[place] = cell[i];
      nearest.weight[place] = weight[i];
    }
  }
  return least <= reach * reach ? nearest : NodeSources{};
}

}  // namespace

NearestInTriangle nearest_in_triangle(const Vector2d& point,
                                      const std::array<Vector2d, 3>& corners) {
  const double area = cross(corners[1] - corners[0], corners[2] - corners[0]);
  if (area != 0) {
    NearestInTriangle inside;
    for (std::size_t i = 0; i < 3; ++i) {
      const Vector2d& b = corners[(i + 1) % 3];
      inside.weight[i] = cross(corners[(i + 2) % 3] - b, point - b) / area;
    }
    if (std::ranges::min(inside.weight) >= 0) return inside;
  }
  NearestInTriangle nearest;
  nearest.squared_distance = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < 3; ++i) {
    const std::size_t j = (i + 1) % 3;
    const Vector2d edge = corners[j] - corners[i];
    const double squared = edge.squaredNorm();
    const double along =
        squared > 0 ? std::clamp((point - corners[i]).dot(edge) / squared, 0.0, 1.0) : 0.0;
    const double distance = (corners[i] + along * edge - point).squaredNorm();
    if (!(distance < nearest.squared_distance)) continue;
    nearest.squared_distance = distance;
    nearest.weight = {};
    nearest.weight[i] = 1 - along;
    nearest.weight[j] = along;
  }
  return nearest;
}

std::vector<NodeSources> node_sources(const Slab& slab, const rig::Rig& rig,
                                      const rig::Topology& present, const rig::Topology& complete) {
  std::vector<Vector3d> centres(rig.cameras.size());
  for (const int camera : slab.cameras) {
    centres[camera] = slab.pose.camera_from_world(rig.cameras[camera].pose.position);
  }
  std::vector<bool> is_present(centres.size());
  for (const rig::Topology::Cell& cell : present.cells) {
    for (const int camera : cell)
      if (camera >= 0) is_present[camera] = true;
  }
  const double spacing = std::max(slab.column_spacing, slab.row_spacing);
  // With one distinct centre, that is the nearest everywhere.
  const double reach =
      slab.nodes() == 1 ? std::numeric_limits<double>::infinity() : spacing * (1 + 1e-6);
  const auto at_node = [&](NodeSources& sources, const Vector3d& node) {
    for (int i = 0; i < sources.count; ++i) {
      const double off = (centres[sources.camera[i]] - node).norm();
      if (off > kSamePlace * spacing && off > 1e-12 * slab.pose.position.norm()) continue;
      sources.camera[0] = sources.camera[i];
      sources.weight = {1, 0, 0};
      sources.count = 1;
      sources.at_camera = true;
      return;
    }
  };

  std::vector<NodeSources> nodes;
  nodes.reserve(slab.nodes());
  for (int row = 0; row < slab.rows; ++row) {
    for (int column = 0; column < slab.columns; ++column) {
      const Vector3d node(column * slab.column_spacing, -row * slab.row_spacing, 0);
      NodeSources sources = sources_in(present, centres, node.head<2>(), reach);
      at_node(sources, node);
      if (&present != &complete) {
        NodeSources wanted = sources_in(complete, centres, node.head<2>(), reach);
        at_node(wanted, node);
        sources.present_weight = wanted.count > 0 ? 0 : 1;
        for (int i = 0; i < wanted.count; ++i) {
          if (is_present[wanted.camera[i]]) sources.present_weight += wanted.weight[i];
        }
      }
      nodes.push_back(sources);
    }
  }
  return nodes;
}

}  // namespace raystage::render
