// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "rig/camera_model.h"
#include "store/jpeg/rgb_image.h"

namespace raystage::exports {

/// Returns the picture that a camera with another lens at the same pose would have taken: codes
/// interpolated bilinearly between pixels, black where the camera saw nothing.
store::RgbImage resample_lens(const store::RgbImage& picture, const rig::CameraModel& from,
                              const rig::CameraModel& to);

}  // namespace raystage::exports
