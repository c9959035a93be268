// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include "rig/camera_model.h"

namespace raystage::render {

/// Returns how far a direction (in the camera's frame, any length) that the model projects is from
/// the limit of the model, 0 to 1: it falls to 0 before the limit (kFoldFade).
double lens_visibility(const rig::CameraModel& model, const Eigen::Vector3d& direction);

/// Returns the visibility of a direction (in the camera's frame, any length), 0 to 1. It falls to 0
/// at the image's border and at the limit of the lens model (kBorderFade, kFoldFade). Sets `pixel`
/// to the image position unless the visibility is 0.
double direction_visibility(const rig::CameraModel& model, const Eigen::Vector3d& direction,
                            Eigen::Vector2d& pixel);

}  // namespace raystage::render
