// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "schemas/photometric_response.h"
#include "schemas/pixel_encoding.h"
#include "store/jpeg/rgb_image.h"
#include "store/jpegxl/deep_picture.h"

namespace raystage::store {

/// Number of values of a 16-bit sample.
inline constexpr std::size_t kSampleValues = 65536;

/// Returns the linear light of a sample, white = 1, not limited to the peak. Half floats that are
/// infinite or not numbers give 0; integers above the largest code count as it.
double light_from_sample(const schemas::PixelEncoding& encoding, std::uint16_t sample);

/// Returns the sample nearest to a light.
std::uint16_t sample_from_light(const schemas::PixelEncoding& encoding, double light);

/// Returns the light of integer samples of full scale; of half floats the largest one.
double largest_light(const schemas::PixelEncoding& encoding);

/// Returns the matrix to linear light with Rec.709 primaries. White stays white (no chromatic
/// adaptation beyond the scale of the primaries). Throws Error (bad input) if the chromaticities do
/// not span colours.
schemas::ColorMatrix rec709_from(const schemas::PixelEncoding& encoding);

/// Returns 8-bit sRGB codes with Rec.709 primaries, clipped at white: to look at.
RgbImage codes_from_picture(const DeepPicture& picture, const schemas::PixelEncoding& encoding);

}  // namespace raystage::store
