// SPDX-License-Identifier: Apache-2.0
#include "rig/pose.h"

namespace raystage::rig {

namespace {

using RowMajor4 = Eigen::Matrix<double, 4, 4, Eigen::RowMajor>;

}  // namespace

Pose pose_from_matrix(const schemas::Matrix4& world_from_camera) {
  const Eigen::Map<const RowMajor4> matrix(world_from_camera.data());
  return {matrix.topLeftCorner<3, 3>(), matrix.topRightCorner<3, 1>()};
}

schemas::Matrix4 matrix_from_pose(const Pose& pose) {
  schemas::Matrix4 result{};
  Eigen::Map<RowMajor4> matrix(result.data());
  matrix << pose.world_from_camera_rotation, pose.position, 0, 0, 0, 1;
  return result;
}

}  // namespace raystage::rig
