// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string_view>

#include "store/jpeg/rgb_image.h"

namespace raystage::compose {

/// Draws digits, minus signs, colons and spaces of 3 x 5 dots of `dot` pixels, with the upper left
/// corner at (x, y). Characters that would exceed `right` are omitted.
void draw_digits(std::string_view text, int x, int y, int right, int dot, store::RgbImage& picture);

/// Draws them on a dark bar at the lower left of the picture, scaled to its height.
void burn_in(std::string_view text, store::RgbImage& picture);

}  // namespace raystage::compose
