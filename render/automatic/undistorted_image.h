// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "rig/camera_model.h"
#include "store/jpeg/rgb_image.h"
#include "store/processing/frames/blend_space.h"
#include "store/processing/frames/frame_cache.h"

namespace raystage {

/// A camera's frame without lens distortion, at its own size and focal length.
struct UndistortedImage {
  RgbImage image;                    ///< 8-bit sRGB codes, photometrically corrected
  std::vector<std::uint8_t> within;  ///< 1 per pixel that the camera saw; the others are black
};

/// Resamples a frame linearly in its codes. `full_scale` and `space` are the cache's.
UndistortedImage undistort_frame(const DecodedFrame& frame, const CameraModel& model,
                                 double full_scale, BlendSpace space);

}  // namespace raystage
