// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <limits>

namespace raystage::render {

/// Accumulates RenderedView::cameras and nearest_ray of one ray, camera by camera.
class RayCoverage {
 public:
  /// Adds a camera with its weight, 0 or more. `ray`: direction, of any length.
  void add(double weight, const Eigen::Vector3d& ray, const Eigen::Vector3d& eye_to_camera) {
    if (!(weight > 0)) return;
    sum_ += weight;
    squares_ += weight * weight;
    nearest_ = std::min(nearest_, eye_to_camera.cross(ray).norm() / ray.norm());
  }
  /// Returns the effective number of cameras, (sum w)^2 / sum w^2; 0 for none.
  float cameras() const { return squares_ > 0 ? static_cast<float>(sum_ * sum_ / squares_) : 0.0F; }
  /// Returns the metres from the ray's line to the nearest camera; +infinity for none.
  float nearest_ray() const { return static_cast<float>(nearest_); }

 private:
  double sum_ = 0, squares_ = 0, nearest_ = std::numeric_limits<double>::infinity();
};

}  // namespace raystage::render
