// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Geometry>
#include <numbers>

#include "rig/pose.h"

namespace raystage::testing {

inline constexpr double kDegree = std::numbers::pi / 180;

/// Returns a pose at `position`, rotated to the left and then upwards.
inline rig::Pose make_pose(const Eigen::Vector3d& position, double yaw_degrees,
                           double pitch_degrees = 0) {
  rig::Pose pose;
  pose.position = position;
  pose.world_from_camera_rotation =
      (Eigen::AngleAxisd(yaw_degrees * kDegree, Eigen::Vector3d::UnitY()) *
       Eigen::AngleAxisd(pitch_degrees * kDegree, Eigen::Vector3d::UnitX()))
          .toRotationMatrix();
  return pose;
}

}  // namespace raystage::testing
