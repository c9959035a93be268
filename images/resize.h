// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "store/jpeg/rgb_image.h"

namespace raystage::images {

/// Returns an image in another size, at least 1 x 1, by OpenImageIO's filters. On the thread of the
/// caller.
store::RgbImage resize(const store::RgbImage& image, int width, int height);

}  // namespace raystage::images
