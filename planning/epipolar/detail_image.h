// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

#include "base/image.h"
#include "render/common/view.h"

namespace raystage::planning {

/// The details of a frame: luma minus its mean around the pixel, in 8-bit codes, so that cameras
/// of different exposure compare. NaN where the frame shows nothing.
struct DetailImage {
  render::VirtualCamera camera;  ///< without distortion, in the size of `detail`
  Image<float> detail;

  /// Returns the detail between pixel centres (at +0.5), bilinear; NaN outside and next to NaN.
  float sample(float x, float y) const;
};

/// Returns the details of a picture that is reduced by a whole factor, with box filter. `luma`:
/// row-major, in the size of `pinhole` (a camera without distortion); 0 is unknown.
DetailImage make_detail_image(const render::VirtualCamera& pinhole,
                              std::span<const std::uint8_t> luma, int factor);

/// Replaces every value by the mean of the square of pixels up to `radius` away that are inside.
/// Two passes of running sums: O(pixels).
void box_filter(Image<float>& image, int radius);

}  // namespace raystage::planning
