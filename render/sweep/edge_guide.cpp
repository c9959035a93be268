// SPDX-License-Identifier: Apache-2.0
#include "render/sweep/edge_guide.h"

#include <algorithm>
#include <cmath>

#include "base/parallel.h"
#include "base/transfer_function.h"
#include "store/processing/frames/matching_code.h"

namespace raystage::render::plane_sweep {

std::vector<std::uint8_t> edge_guide(const RenderedView& picture, const store::CodeScale& scale) {
  std::vector<std::uint8_t> guide(picture.coverage.size());
  const auto width = static_cast<std::size_t>(picture.width);
  raystage::parallel_for(0, picture.height, [&](int y) {
    for (std::size_t at = static_cast<std::size_t>(y) * width, x = 0; x < width; ++at, ++x) {
      const float* rgba = &picture.rgba[4 * at];
      if (rgba[3] <= 0) continue;
      const double luminance =
          (0.2126 * static_cast<double>(rgba[0]) + 0.7152 * static_cast<double>(rgba[1]) +
           0.0722 * static_cast<double>(rgba[2])) /
          (static_cast<double>(rgba[3]) * scale.full_scale);
      const double part = std::clamp(luminance, 0.0, 1.0);
      const double code = scale.space == store::BlendSpace::kHighRange
                              ? store::matching_code(scale, part * scale.full_scale)
                              : srgb_from_linear(part);
      guide[at] = static_cast<std::uint8_t>(std::lround(255 * code));
    }
  });
  return guide;
}

}  // namespace raystage::render::plane_sweep
