// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "store/jpeg/rgb_image.h"

namespace raystage::images {

/// Returns an image in another size, at least 1 x 1: each pixel is the mean of the area that it
/// covers in directions in which the image shrinks, and interpolated linearly in the others.
store::RgbImage resize(const store::RgbImage& image, int width, int height);

}  // namespace raystage::images
