// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include "rig/camera_model.h"

namespace raystage {

/// How far a camera sees along a direction (of its own frame, any length), 0 to 1: falling to 0 at
/// the image's border and the lens model's end (kBorderFade, kFoldFade); and where in its image,
/// unless 0.
double direction_visibility(const CameraModel& model, const Eigen::Vector3d& direction,
                            Eigen::Vector2d& pixel);

}  // namespace raystage
