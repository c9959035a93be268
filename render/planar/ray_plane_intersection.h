// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <limits>
#include <optional>

#include "render/common/plane_projection.h"

namespace raystage::render {

/// The intersection of a ray with the plane n.X + c = 0, as a direction from each camera: (X - C)
/// for a finite plane, the ray itself for a plane at infinity. is_in_front() is false where the ray
/// does not meet the plane in front of its origin.
class RayPlaneIntersection {
 public:
  RayPlaneIntersection(const Eigen::Vector3d& eye, const Eigen::Vector3d& ray,
                       const Eigen::Vector4d& plane) {
    const Eigen::Vector3d normal = plane.head<3>();
    if (normal.isZero(0)) {
      direction_ = ray;
      depth_ = std::numeric_limits<double>::infinity();
      return;
    }
    depth_ = -signed_plane_distance(plane, eye) / normal.normalized().dot(ray);
    from_eye_ = depth_ * ray;
    eye_ = eye;
  }
  /// Creates the point at a planar depth in metres, which may be infinite, or not-a-number for no
  /// point.
  RayPlaneIntersection(const Eigen::Vector3d& eye, const Eigen::Vector3d& ray, double depth)
      : from_eye_(depth * ray), eye_(eye), depth_(depth) {
    if (std::isinf(depth)) direction_ = ray;
  }
  bool is_in_front() const { return depth_ > 0; }
  double depth() const { return depth_; }
  Eigen::Vector3d direction_from(const Eigen::Vector3d& centre) const {
    return direction_ ? *direction_ : Eigen::Vector3d(from_eye_ + (eye_ - centre));
  }

 private:
  std::optional<Eigen::Vector3d> direction_;
  Eigen::Vector3d from_eye_ = Eigen::Vector3d::Zero(), eye_ = Eigen::Vector3d::Zero();
  double depth_ = 0;
};

}  // namespace raystage::render
