// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "render/common/view.h"
#include "store/jpeg/rgb_image.h"

namespace raystage {

/// How near an image comes to the truth, over the pixels that were reconstructed.
struct ImageQuality {
  double psnr_db = 0;  ///< peak 255; infinity when equal; not-a-number without covered pixels
  double ssim = 0;     ///< mean structural similarity; not-a-number without covered pixels
  double covered = 0;  ///< part of the pixels compared, 0 to 1
};

/// A reconstructed view as 8-bit sRGB codes, un-premultiplied, black where nothing was seen.
RgbImage srgb_image(const RenderedView& view);

/// 1 per pixel that counts as covered: every camera it is made of saw the ray (alpha >= 0.999).
std::vector<std::uint8_t> coverage_mask(const RenderedView& view);

/// PSNR over all channels, and SSIM (Wang, Bovik, Sheikh, Simoncelli 2004: Gaussian window of 11
/// with sigma 1.5, K1 = 0.01, K2 = 0.03; per channel, then the mean; windows count covered pixels
/// only, weights normalised). Both on 8-bit codes. Throws Error (bad input) when the sizes differ.
ImageQuality compare_images(const RgbImage& image, const RgbImage& truth,
                            std::span<const std::uint8_t> covered);

}  // namespace raystage
