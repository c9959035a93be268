// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "store/jpeg/rgb_image.h"

namespace raystage::replay {

struct PictureSize {
  int width = 0, height = 0;  ///< pixels
};

/// Returns the largest size of this shape that fits into `room`; at least 1 x 1.
PictureSize fitting_size(PictureSize shape, PictureSize room);

/// Copies a picture into a larger one, with its upper left corner at (x, y).
void copy_into(const store::RgbImage& from, int x, int y, store::RgbImage& to);

}  // namespace raystage::replay
