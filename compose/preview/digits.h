// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string_view>

#include "store/jpeg/rgb_image.h"

namespace raystage {

/// Draws digits, minus signs, colons and spaces of 3 x 5 dots, `dot` pixels each, from (x, y) on,
/// the upper left; those that would reach beyond `right` are left out.
void draw_digits(std::string_view text, int x, int y, int right, int dot, RgbImage& picture);

/// Draws them on a dark bar in the picture's lower left, as tall as suits its height.
void burn_in(std::string_view text, RgbImage& picture);

}  // namespace raystage
