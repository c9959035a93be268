// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <numbers>

#include "rig/radial_projection.h"

namespace raystage::rig {
namespace {

class EquisolidProjection final : public RadialProjection {
 public:
  double largest_angle() const override { return std::numbers::pi; }
  double distance(double angle) const override { return 2 * std::sin(angle / 2); }
  double slope(double angle) const override { return std::cos(angle / 2); }
  double angle(double distance) const override {
    return 2 * std::asin(std::fmin(1.0, distance / 2));
  }
};

}  // namespace

const RadialProjection& equisolid_projection() {
  static const EquisolidProjection projection;
  return projection;
}

}  // namespace raystage::rig
