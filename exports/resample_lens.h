// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include "rig/camera_model.h"
#include "store/jpeg/rgb_image.h"

namespace raystage::exports {

/// Returns the picture that a camera with another lens at the same position would have taken: codes
/// interpolated bilinearly between pixels, black where the camera saw nothing. `from_to`: rotation
/// from the axes of the other camera to those of the camera.
store::RgbImage resample_lens(const store::RgbImage& picture, const rig::CameraModel& from,
                              const rig::CameraModel& to,
                              const Eigen::Matrix3d& from_to = Eigen::Matrix3d::Identity());

}  // namespace raystage::exports
