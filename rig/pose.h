// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include "schemas/geometry.h"

namespace raystage::rig {

/// Position and rotation of a camera: x_in_world = rotation * x_in_camera + position.
/// Camera x right, y up, looks down -z; world right-handed, metres, y up.
struct Pose {
  Eigen::Matrix3d world_from_camera_rotation = Eigen::Matrix3d::Identity();
  Eigen::Vector3d position = Eigen::Vector3d::Zero();

  Eigen::Vector3d world_from_camera(const Eigen::Vector3d& x_in_camera) const {
    return world_from_camera_rotation * x_in_camera + position;
  }
  Eigen::Vector3d camera_from_world(const Eigen::Vector3d& x_in_world) const {
    return world_from_camera_rotation.transpose() * (x_in_world - position);
  }
  /// Returns the camera's viewing direction, a unit vector in the world.
  Eigen::Vector3d viewing_direction() const { return -world_from_camera_rotation.col(2); }
};

/// Returns the pose of a rigid matrix. Rigidity is checked when documents are read, not here.
Pose pose_from_matrix(const schemas::Matrix4& world_from_camera);
schemas::Matrix4 matrix_from_pose(const Pose& pose);

}  // namespace raystage::rig
