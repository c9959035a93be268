// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>

#include "rig/radial_projection.h"
#include "schemas/geometry.h"

namespace raystage::rig {

/// A lens that may see a hemisphere and more: a projection that is symmetric about the axis, and a
/// distortion r' = r + k[0] r^3 + k[1] r^5 + k[2] r^7 + k[3] r^9 of its distance r.
///
/// The lens ends at its half angle, or before where r' stops rising: two rays would map to one
/// point there. Directions are (x right, y down, z along the axis), of any length but 0; image
/// points are in focal lengths from the principal point, y down.
class FisheyeLens {
 public:
  /// Throws std::logic_error for a pinhole.
  explicit FisheyeLens(const schemas::Intrinsics& intrinsics);

  /// Returns the largest angle of a ray to the axis, radians; 0: the lens sees nothing.
  double largest_angle() const { return largest_angle_; }
  /// Returns the distance r' of an angle in [0, largest_angle()].
  double distance(double angle) const;
  /// Returns the derivative of distance().
  double slope(double angle) const;
  /// Returns the angle of a distance, or nullopt beyond the largest angle.
  std::optional<double> angle(double distance) const;

  /// Returns the image point of a direction, or nullopt beyond the largest angle.
  std::optional<Eigen::Vector2d> image_from_direction(const Eigen::Vector3d& direction) const;
  /// Returns the unit direction of an image point, or nullopt beyond the largest angle.
  std::optional<Eigen::Vector3d> direction_from_image(const Eigen::Vector2d& point) const;

 private:
  const RadialProjection* projection_;
  std::array<double, 4> distortion_;
  double largest_angle_ = 0, largest_undistorted_ = 0, largest_distance_ = 0;
};

}  // namespace raystage::rig
