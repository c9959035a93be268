// SPDX-License-Identifier: Apache-2.0
// Adds MCUs to a partly decoded JPEG frame. Chroma upsampling at an MCU depends on its eight
// neighbours, so held MCUs next to new ones are decoded again. Of these, the quarters that touch no
// new MCU are copied from the held frame. Inputs: masks with one value per MCU, frames with 4
// values per pixel. Cost: O(MCUs) for the masks, O(held pixels) for the copy.
#include "store/processing/frames/incremental_decode.h"

#include <algorithm>
#include <cassert>

namespace raystage::store {
namespace {

struct Rectangle {
  int x0 = 0, y0 = 0, x1 = 0, y1 = 0;  // pixels, the last ones excluded
};

void copy(const JpegLayout& layout, const Rectangle& part, std::span<const std::uint16_t> from,
          std::span<std::uint16_t> to) {
  const int end = std::min(part.x1, layout.width);
  if (part.x0 >= end) return;
  for (int y = part.y0; y < std::min(part.y1, layout.height); ++y) {
    const std::size_t first = 4 * (static_cast<std::size_t>(y) * layout.width + part.x0);
    const std::size_t count = 4 * static_cast<std::size_t>(end - part.x0);
    std::ranges::copy(from.subspan(first, count), to.subspan(first, count).begin());
  }
}

}  // namespace

IncrementalDecode::IncrementalDecode(const JpegLayout& layout, const McuMask& held,
                                     const McuMask& wanted)
    : layout_(layout), new_(held.size()), together_(held.size()), to_decode_(held.size()) {
  assert(held.size() == static_cast<std::size_t>(layout.mcu_count()));
  assert(wanted.size() == held.size());
  for (std::size_t i = 0; i < held.size(); ++i) {
    new_[i] = wanted[i] != 0 && held[i] == 0 ? 1 : 0;
    together_[i] = wanted[i] != 0 || held[i] != 0 ? 1 : 0;
  }
  const int reach = layout.mcu_width > 8 || layout.mcu_height > 8 ? 1 : 0;
  for (int row = 0; row < layout.mcu_rows; ++row) {
    for (int column = 0; column < layout.mcus_per_row; ++column) {
      if (!is_new(column, row)) continue;
      for (int y = std::max(row - reach, 0); y <= std::min(row + reach, layout.mcu_rows - 1); ++y) {
        for (int x = std::max(column - reach, 0);
             x <= std::min(column + reach, layout.mcus_per_row - 1); ++x) {
          const auto i = static_cast<std::size_t>(y * layout.mcus_per_row + x);
          to_decode_[i] = together_[i];
        }
      }
    }
  }
}

bool IncrementalDecode::is_new(int column, int row) const {
  return column >= 0 && column < layout_.mcus_per_row && row >= 0 && row < layout_.mcu_rows &&
         new_[row * layout_.mcus_per_row + column] != 0;
}

void IncrementalDecode::copy_held(std::span<const std::uint16_t> held,
                                  std::span<std::uint16_t> frame) const {
  const int width = layout_.mcu_width, height = layout_.mcu_height;
  for (int row = 0; row < layout_.mcu_rows; ++row) {
    for (int column = 0; column < layout_.mcus_per_row; ++column) {
      const auto i = static_cast<std::size_t>(row * layout_.mcus_per_row + column);
      if (together_[i] == 0 || new_[i] != 0) continue;
      const Rectangle mcu{column * width, row * height, (column + 1) * width, (row + 1) * height};
      if (to_decode_[i] == 0) {
        copy(layout_, mcu, held, frame);
        continue;
      }
      // Chroma is interpolated from the nearest samples: a quarter of an MCU depends on the three
      // neighbours that it touches. If one of them is new, the quarter was decoded again.
      const int x = mcu.x0 + width / 2, y = mcu.y0 + height / 2;
      const auto keep = [&](const Rectangle& quarter, int right, int down) {
        if (is_new(column + right, row) || is_new(column, row + down) ||
            is_new(column + right, row + down)) {
          return;
        }
        copy(layout_, quarter, held, frame);
      };
      keep({mcu.x0, mcu.y0, x, y}, -1, -1);
      keep({x, mcu.y0, mcu.x1, y}, 1, -1);
      keep({mcu.x0, y, x, mcu.y1}, -1, 1);
      keep({x, y, mcu.x1, mcu.y1}, 1, 1);
    }
  }
}

}  // namespace raystage::store
