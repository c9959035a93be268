// SPDX-License-Identifier: Apache-2.0
#include "render/sampling/direction_visibility.h"

#include <algorithm>
#include <cmath>

#include "render/sampling/source_view.h"

namespace raystage::render {

double lens_visibility(const rig::CameraModel& model, const Eigen::Vector3d& direction) {
  if (!model.has_distortion()) return 1;
  double part = 0;  // of the limit, squared
  if (const rig::FisheyeLens* lens = model.fisheye()) {
    const double angle = std::atan2(direction.head<2>().norm(), -direction.z());
    part = angle * angle / (lens->largest_angle() * lens->largest_angle());
  } else {
    part = (direction.head<2>() / direction.z()).squaredNorm() / model.fold_radius_squared();
  }
  return std::clamp((1 - part) * double{kFoldFade}, 0.0, 1.0);
}

double direction_visibility(const rig::CameraModel& model, const Eigen::Vector3d& direction,
                            Eigen::Vector2d& pixel) {
  const auto projected = model.project(direction);
  if (!projected) return 0;
  pixel = *projected;
  const double to_border =
      std::min({pixel.x(), model.width() - pixel.x(), pixel.y(), model.height() - pixel.y()});
  const double seen = std::clamp(to_border * double{kBorderFade}, 0.0, 1.0);
  return seen * lens_visibility(model, direction);
}

}  // namespace raystage::render
