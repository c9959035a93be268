// SPDX-License-Identifier: Apache-2.0
// Views of rays by a pinhole that faces their mean direction.
#include "calibrate/geometry/ray_view.h"

#include <Eigen/Geometry>
#include <cmath>

namespace raystage::calibrate {

using Eigen::Vector3d;

RayView::RayView(const rig::CameraModel& lens, std::span<const Vector3d> rays, double largest_angle)
    : least_cosine_(std::cos(largest_angle)), is_fisheye_(lens.fisheye() != nullptr) {
  if (!is_fisheye_) return;
  Vector3d sum = Vector3d::Zero();
  for (const Vector3d& ray : rays) sum += ray.normalized();
  // Rays all around have no mean: then the view is that of the camera.
  constexpr double kLeastMean = 1e-3;
  if (!(sum.norm() > kLeastMean * static_cast<double>(rays.size()))) return;
  camera_from_view_ =
      Eigen::Quaterniond::FromTwoVectors(Vector3d(0, 0, -1), sum).normalized().toRotationMatrix();
}

std::optional<Eigen::Vector2d> RayView::point(const Vector3d& ray) const {
  if (!is_fisheye_) return Eigen::Vector2d(ray.x() / -ray.z(), ray.y() / ray.z());
  const Vector3d in_view = camera_from_view_.transpose() * ray;
  if (!(-in_view.z() >= least_cosine_ * in_view.norm())) return std::nullopt;
  return Eigen::Vector2d(in_view.x() / -in_view.z(), in_view.y() / in_view.z());
}

}  // namespace raystage::calibrate
