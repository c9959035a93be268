// SPDX-License-Identifier: Apache-2.0
#include <numbers>

#include "rig/radial_projection.h"

namespace raystage::rig {
namespace {

class EquidistantProjection final : public RadialProjection {
 public:
  double largest_angle() const override { return std::numbers::pi; }
  double distance(double angle) const override { return angle; }
  double slope(double) const override { return 1; }
  double angle(double distance) const override { return distance; }
};

}  // namespace

const RadialProjection& equidistant_projection() {
  static const EquidistantProjection projection;
  return projection;
}

}  // namespace raystage::rig
