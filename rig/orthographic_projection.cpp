// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <numbers>

#include "rig/radial_projection.h"

namespace raystage::rig {
namespace {

class OrthographicProjection final : public RadialProjection {
 public:
  double largest_angle() const override { return std::numbers::pi / 2; }
  double distance(double angle) const override { return std::sin(angle); }
  double slope(double angle) const override { return std::cos(angle); }
  double angle(double distance) const override { return std::asin(std::fmin(1.0, distance)); }
};

}  // namespace

const RadialProjection& orthographic_projection() {
  static const OrthographicProjection projection;
  return projection;
}

}  // namespace raystage::rig
