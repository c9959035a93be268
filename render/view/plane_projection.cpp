// SPDX-License-Identifier: Apache-2.0
#include "render/view/plane_projection.h"

#include <cmath>
#include <limits>

#include "render/view/ray_cells.h"
#include "schemas/error.h"

namespace raystage {

PlaneProjection::PlaneProjection(const VirtualCamera& view, const Eigen::Vector4d& plane)
    : ray_from_pixel_(world_ray_from_pixel(view)), eye_(view.pose.position) {
  if (!plane.allFinite() || plane.isZero(0)) {
    throw Error::bad_input("the focal plane's equation is zero or not finite", "focal plane",
                           "Give a x + b y + c z + d = 0 with finite numbers, not all 0");
  }
  const double length = plane.head<3>().norm();
  at_infinity_ = length == 0;
  const Eigen::Vector4d unit = at_infinity_ ? Eigen::Vector4d(0, 0, 0, 1) : plane / length;
  const double height = unit.head<3>().dot(eye_) + unit.w();
  distance_ = std::abs(height);
  // n.d of the pixels, turned so that it is positive where the plane lies in front of the eye.
  slope_ = (height > 0 ? -1.0 : 1.0) * (ray_from_pixel_.transpose() * unit.head<3>());
}

Eigen::Matrix3d PlaneProjection::ideal_from_pixel(const Pose& camera) const {
  const Eigen::Matrix3d relative_point =
      distance_ * ray_from_pixel_ + (eye_ - camera.position) * slope_.transpose();
  Eigen::Matrix3d ideal = camera.world_from_camera_rotation.transpose() * relative_point;
  ideal.row(1) *= -1;  // camera y up, image y down
  ideal.row(2) *= -1;  // the camera looks down -z
  return ideal;
}

double PlaneProjection::depth(double x, double y) const {
  if (at_infinity_) return std::numeric_limits<double>::infinity();
  const double along = slope_.dot(Eigen::Vector3d(x, y, 1));
  return along > 0 ? distance_ / along : 0;
}

}  // namespace raystage
