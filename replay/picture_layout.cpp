// SPDX-License-Identifier: Apache-2.0
#include "replay/picture_layout.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace raystage::replay {

PictureSize fitting_size(PictureSize shape, PictureSize room) {
  const double scale = std::min(static_cast<double>(room.width) / shape.width,
                                static_cast<double>(room.height) / shape.height);
  return {std::clamp(static_cast<int>(std::lround(shape.width * scale)), 1, room.width),
          std::clamp(static_cast<int>(std::lround(shape.height * scale)), 1, room.height)};
}

void copy_into(const store::RgbImage& from, int x, int y, store::RgbImage& to) {
  for (int row = 0; row < from.height; ++row) {
    std::ranges::copy(from.row(row), to.row(y + row).begin() + std::ptrdiff_t{3} * x);
  }
}

}  // namespace raystage::replay
