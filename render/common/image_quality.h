// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "render/common/view.h"
#include "store/jpeg/rgb_image.h"

namespace raystage::render {

/// The quality of an image against the ground truth, over the pixels that were reconstructed.
struct ImageQuality {
  double psnr_db = 0;  ///< peak 255; infinity if equal; not-a-number without covered pixels
  double ssim = 0;     ///< mean structural similarity; not-a-number without covered pixels
  double covered = 0;  ///< fraction of the pixels compared, 0 to 1
};

/// Returns a reconstructed view as 8-bit sRGB codes, un-premultiplied, black where no camera saw
/// the ray.
store::RgbImage srgb_image(const RenderedView& view);

/// Returns 1 for each covered pixel: one whose ray all its cameras saw (alpha >= 0.999).
std::vector<std::uint8_t> coverage_mask(const RenderedView& view);

/// Computes PSNR over all channels and SSIM (Wang, Bovik, Sheikh, Simoncelli 2004: Gaussian window
/// of 11 with sigma 1.5, K1 = 0.01, K2 = 0.03; per channel, then the mean). Windows use covered
/// pixels only, with normalised weights. Both compare 8-bit codes. Throws Error (bad input) if the
/// sizes differ.
ImageQuality compare_images(const store::RgbImage& image, const store::RgbImage& truth,
                            std::span<const std::uint8_t> covered);

/// Returns the multi-scale structural similarity (Wang, Simoncelli, Bovik 2003) around the pixels
/// of a mask, with the windows of compare_images(): five scales, each of half the size of the one
/// before, weighted 0.0448, 0.2856, 0.3001, 0.2363 and 0.1333, in relation to each other where the
/// images are smaller than 11 pixels at some. A smaller pixel is in the mask if one of its four is,
/// and covered if all are. NaN without a covered pixel in the mask at some scale. Throws Error (bad
/// input) if the sizes differ.
double multi_scale_ssim(const store::RgbImage& image, const store::RgbImage& truth,
                        std::span<const std::uint8_t> covered, std::span<const std::uint8_t> mask);

}  // namespace raystage::render
