// SPDX-License-Identifier: Apache-2.0
#include "rig/pose.h"

namespace raystage {

Pose pose_from_matrix(const Matrix4& world_from_camera) {
  Pose pose;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) {
      pose.world_from_camera_rotation(row, column) =
          world_from_camera[static_cast<std::size_t>(4 * row + column)];
    }
    pose.position(row) = world_from_camera[static_cast<std::size_t>(4 * row + 3)];
  }
  return pose;
}

Matrix4 matrix_from_pose(const Pose& pose) {
  Matrix4 matrix{0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1};
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) {
      matrix[static_cast<std::size_t>(4 * row + column)] =
          pose.world_from_camera_rotation(row, column);
    }
    matrix[static_cast<std::size_t>(4 * row + 3)] = pose.position(row);
  }
  return matrix;
}

}  // namespace raystage
