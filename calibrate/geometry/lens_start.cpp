// SPDX-License-Identifier: Apache-2.0
// Initial lenses from a field of view.
#include "calibrate/geometry/lens_start.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "calibrate/geometry/lens_projection.h"

namespace raystage::calibrate {
namespace {

/// Returns the distance of an angle; beyond the end of the projection it rises like the angle.
double rising_distance(const rig::RadialProjection& projection, double angle) {
  const double end = projection.largest_angle();
  return angle <= end ? projection.distance(angle) : projection.distance(end) + (angle - end);
}

}  // namespace

schemas::Intrinsics initial_lens(const LensModel& model, int width, int height,
                                 double horizontal_fov) {
  schemas::Intrinsics lens;
  lens.projection = model.projection;
  const rig::RadialProjection* fisheye = fisheye_projection(lens);
  lens.fx = fisheye == nullptr ? width / 2.0 / std::tan(horizontal_fov / 2)
                               : width / 2.0 / rising_distance(*fisheye, horizontal_fov / 2);
  lens.fy = lens.fx;
  lens.cx = width / 2.0;
  lens.cy = height / 2.0;
  if (fisheye != nullptr) lens.half_angle = model.half_angle;
  return lens;
}

double horizontal_fov(const schemas::Intrinsics& lens, int width) {
  const double distance = width / 2.0 / lens.fx;
  const rig::RadialProjection* fisheye = fisheye_projection(lens);
  if (fisheye == nullptr) return 2 * std::atan(distance);
  const double end = fisheye->largest_angle(), at_end = fisheye->distance(end);
  return 2 * (distance <= at_end ? fisheye->angle(distance) : end + (distance - at_end));
}

std::vector<double> trial_fovs(std::span<const LensModel> models) {
  const bool has_fisheyes = std::ranges::any_of(models, [](const LensModel& model) {
    return model.projection != schemas::Projection::kPinhole;
  });
  std::vector<double> degrees{15, 25, 40, 55, 70, 90, 110};
  if (has_fisheyes) degrees = {80, 105, 130, 160, 190, 230, 270};
  for (double& value : degrees) value *= std::numbers::pi / 180;
  return degrees;
}

}  // namespace raystage::calibrate
