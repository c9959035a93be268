// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

#include "compose/layers/layer_image.h"

namespace raystage::compose {

struct ImageSize {
  int width = 0, height = 0;
  bool operator==(const ImageSize&) const = default;
};

/// Computes premultiplied R, G, B, A at a size that is at most its own, into `result` of that size.
/// Each pixel is the mean of the area that it covers.
void scale_down_rgba(std::span<const float> rgba, ImageSize size, ImageSize scaled,
                     std::span<float> result);

/// Returns an image at a size that is at most its own: colours as scale_down_rgba(), depth of the
/// pixel at each centre, without AOVs.
LayerImage scale_down(const LayerImage& image, ImageSize scaled);

}  // namespace raystage::compose
