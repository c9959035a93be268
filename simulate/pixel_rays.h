// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cmath>

#include "base/image.h"
#include "rig/camera_model.h"
#include "rig/pose.h"
#include "simulate/world.h"

namespace raystage::simulate {

/// Computes the ray of every pixel of a camera once. Coordinates: world, metres.
class PixelRays {
 public:
  explicit PixelRays(const rig::CameraModel& model, const rig::Pose& pose);

  int width() const { return width_; }
  int height() const { return height_; }
  /// Returns false where the distortion model maps no ray to the pixel (see CameraModel's fold).
  bool has_ray(int column, int row) const;
  /// Returns the ray through position (x, y) of the pixel, each in [0, 1); the centre is 0.5.
  Ray ray(int column, int row, float x, float y) const;
  /// Returns the part of a distance along the ray through a pixel's centre that is along the
  /// optical axis.
  float forward_share(int column, int row) const {
    const Eigen::Vector3f& towards = in_camera(column, row);
    return -towards.z() / towards.norm();
  }
  /// Returns the width of a pixel at a distance of 1 m, in metres.
  float footprint() const { return footprint_; }

 private:
  const Eigen::Vector3f& in_camera(int column, int row) const {
    return in_camera_.at(column + 1, row + 1);
  }

  int width_, height_;
  float footprint_;
  Eigen::Matrix3f world_from_camera_;
  Eigen::Vector3f position_;
  /// Rays at pixel centres as CameraModel::unproject() scales them, with a border of 1 pixel; NaN:
  /// there is none.
  Image<Eigen::Vector3f> in_camera_;
};

}  // namespace raystage::simulate
