// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <numbers>
#include <optional>
#include <span>

#include "rig/camera_model.h"
#include "rig/pose.h"

namespace raystage::calibrate {

/// A pinhole of focal length 1 at the place of a camera that shows some of its rays. A fisheye's
/// faces the mean of the rays, which may point sideways or back; a pinhole's is the camera itself.
class RayView {
 public:
  /// Rays of a fisheye have points up to this angle from the axis of the view; pixels have there
  /// four times the size of those on the axis.
  static constexpr double kLargestAngle = std::numbers::pi / 3;

  /// `rays`: in the axes of the camera, of any length.
  RayView(const rig::CameraModel& lens, std::span<const Eigen::Vector3d> rays,
          double largest_angle = kLargestAngle);

  /// Returns the ideal image point (y down) of a ray of the camera; none if it is too far from the
  /// axis.
  std::optional<Eigen::Vector2d> point(const Eigen::Vector3d& ray) const;

  const Eigen::Matrix3d& camera_from_view() const { return camera_from_view_; }

 private:
  Eigen::Matrix3d camera_from_view_ = Eigen::Matrix3d::Identity();
  double least_cosine_ = 0;  // of a fisheye's rays to the axis
  bool is_fisheye_ = false;
};

}  // namespace raystage::calibrate
