// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "schemas/geometry.h"

namespace raystage::rig {

/// A projection of a lens without distortion that is symmetric about its axis: how the angle
/// between a ray and the axis, radians, becomes a distance from the principal point, focal lengths.
/// To add a projection: a file that implements this, and what README.md of this folder lists.
class RadialProjection {
 public:
  virtual ~RadialProjection() = default;
  /// Returns the largest angle at which the distance still increases, in (0, pi].
  virtual double largest_angle() const = 0;
  /// Returns the distance of an angle in [0, largest_angle()].
  virtual double distance(double angle) const = 0;
  /// Returns the derivative of distance().
  virtual double slope(double angle) const = 0;
  /// Returns the angle of a distance in [0, distance(largest_angle())].
  virtual double angle(double distance) const = 0;
};

/// Returns the projection of a fisheye lens. It lives until the program ends. Throws
/// std::logic_error for Projection::kPinhole, which reaches no hemisphere.
const RadialProjection& radial_projection(schemas::Projection projection);

/// Distance = angle: OpenCV's fisheye, f-theta lenses.
const RadialProjection& equidistant_projection();
/// Distance = 2 sin(angle / 2): equal solid angles have equal areas.
const RadialProjection& equisolid_projection();
/// Distance = sin(angle), up to a hemisphere.
const RadialProjection& orthographic_projection();

}  // namespace raystage::rig
