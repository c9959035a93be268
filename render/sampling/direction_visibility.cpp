// SPDX-License-Identifier: Apache-2.0
#include "render/sampling/direction_visibility.h"

#include <algorithm>

#include "render/sampling/source_view.h"

namespace raystage::render {

double direction_visibility(const rig::CameraModel& model, const Eigen::Vector3d& direction,
                            Eigen::Vector2d& pixel) {
  if (!(direction.z() < 0)) return 0;
  const Eigen::Vector2d ideal(direction.x() / -direction.z(), direction.y() / direction.z());
  const auto projected = model.pixel_from_ideal(ideal);
  if (!projected) return 0;
  pixel = *projected;
  const double to_border =
      std::min({pixel.x(), model.width() - pixel.x(), pixel.y(), model.height() - pixel.y()});
  const double seen = std::clamp(to_border * double{kBorderFade}, 0.0, 1.0);
  if (!model.has_distortion()) return seen;
  const double to_fold = 1 - ideal.squaredNorm() / model.fold_radius_squared();
  return seen * std::clamp(to_fold * double{kFoldFade}, 0.0, 1.0);
}

}  // namespace raystage::render
