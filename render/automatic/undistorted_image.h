// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "rig/camera_model.h"
#include "store/jpeg/rgb_image.h"
#include "store/processing/frames/blend_space.h"
#include "store/processing/frames/frame_cache.h"

namespace raystage::render {

/// A camera's frame without lens distortion, at its own size and focal length.
struct UndistortedImage {
  store::RgbImage image;             ///< 8-bit sRGB codes, photometrically corrected
  std::vector<std::uint8_t> within;  ///< 1 per pixel that the camera saw; the others are black
};

/// Resamples a frame linearly in its codes. `full_scale` and `space` are the cache's.
UndistortedImage undistort_frame(const store::DecodedFrame& frame, const rig::CameraModel& model,
                                 double full_scale, store::BlendSpace space);

}  // namespace raystage::render
