// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Geometry>
#include <vector>

#include "meshes/decoded_scene.h"

namespace raystage::meshes {

/// Returns the transforms of all nodes to the coordinates of the file, without animation.
inline std::vector<Eigen::Affine3d> file_from_nodes(const DecodedScene& scene) {
  std::vector<Eigen::Affine3d> result;
  result.reserve(scene.nodes.size());
  for (const DecodedScene::Node& node : scene.nodes) {
    Eigen::Affine3d parent_from_node = Eigen::Affine3d::Identity();
    using Rows = Eigen::Matrix<float, 3, 4, Eigen::RowMajor>;
    parent_from_node.affine() = Eigen::Map<const Rows>(node.parent_from_node.data()).cast<double>();
    result.push_back(node.parent == DecodedScene::kNone ? parent_from_node
                                                        : result[node.parent] * parent_from_node);
  }
  return result;
}

}  // namespace raystage::meshes
