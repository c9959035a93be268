// SPDX-License-Identifier: Apache-2.0
// The homography from a view to a camera through a focal plane (thesis 4.1.2), without a division
// by depth. Signed distances use a compensated sum (Ogita, Rump and Oishi 2005). Input: plane a x +
// b y + c z + d = 0 in the world, metres. Output: 3x3 matrices per camera. Cost: constant per
// camera.

#include "render/common/plane_projection.h"

#include <cmath>
#include <limits>

#include "base/error.h"
#include "render/common/ray_cells.h"

namespace raystage::render {
namespace {

/// Beyond these limits, distances and their inverses exceed the range of a float.
constexpr double kFarthest = 1e30, kClosest = 1e-30;

/// Returns the same plane with its largest coefficient near 1; exact, as only exponents change.
Eigen::Vector4d moderate(const Eigen::Vector4d& plane) {
  const int exponent = std::ilogb(plane.cwiseAbs().maxCoeff());
  return plane.unaryExpr([&](double number) { return std::ldexp(number, -exponent); });
}

}  // namespace

double signed_plane_distance(const Eigen::Vector4d& given, const Eigen::Vector3d& point) {
  const Eigen::Vector4d plane = moderate(given);
  double sum = plane.w(), lost = 0, magnitude = std::abs(plane.w());
  for (int axis = 0; axis < 3; ++axis) {
    const double product = plane(axis) * point(axis);
    const double next = sum + product, added = next - sum;
    lost +=
        std::fma(plane(axis), point(axis), -product) + ((sum - (next - added)) + (product - added));
    sum = next;
    magnitude += std::abs(product);
  }
  const double height = sum + lost;
  // A sum below the rounding error of its terms is 0, e.g. for a plane through the virtual camera.
  if (std::abs(height) <= 4 * std::numeric_limits<double>::epsilon() * magnitude) return 0;
  const double metres = height / plane.head<3>().norm();
  return std::abs(metres) < kClosest ? 0 : metres;
}

PlaneProjection::PlaneProjection(const VirtualCamera& view, const Eigen::Vector4d& plane)
    : ray_from_pixel_(world_ray_from_pixel(view)), eye_(view.pose.position) {
  if (!plane.allFinite() || plane.isZero(0)) {
    throw Error::bad_input("the focal plane's equation is zero or not finite", "focal plane",
                           "Give a x + b y + c z + d = 0 with finite numbers, not all 0");
  }
  at_infinity_ = plane.head<3>().isZero(0);
  if (at_infinity_) {
    distance_ = 1;
    slope_.setZero();
    return;
  }
  const Eigen::Vector4d given = moderate(plane);
  const double length = given.head<3>().norm();
  if (std::abs(given.w()) > kFarthest * length) {
    throw Error::bad_input("the focal plane is further away than 1e30 m", "focal plane",
                           "Use 0 0 0 1 for a plane at infinity");
  }
  const double height = signed_plane_distance(plane, eye_);
  distance_ = std::abs(height);
  // n.d of the pixels, with the sign that makes it positive where the plane lies in front of the
  // eye.
  slope_ = (height > 0 ? -1.0 : 1.0) * (ray_from_pixel_.transpose() * (given.head<3>() / length));
}

Eigen::Matrix3d PlaneProjection::ideal_from_pixel(const rig::Pose& camera) const {
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

}  // namespace raystage::render
