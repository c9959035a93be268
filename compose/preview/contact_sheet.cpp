// SPDX-License-Identifier: Apache-2.0
#include "compose/preview/contact_sheet.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cstdint>
#include <string>

namespace raystage {
namespace {

constexpr int kGap = 8, kLabelHeight = 16, kDot = 2;
constexpr std::uint8_t kPaper = 38, kInk = 220;

/// Digits of 3 x 5 dots, a row in three bits from the top; then the minus sign.
constexpr std::array<std::array<std::uint8_t, 5>, 11> kGlyphs{{{7, 5, 5, 5, 7},
                                                               {2, 6, 2, 2, 7},
                                                               {7, 1, 7, 4, 7},
                                                               {7, 1, 7, 1, 7},
                                                               {5, 5, 7, 1, 1},
                                                               {7, 4, 7, 1, 7},
                                                               {7, 4, 7, 5, 7},
                                                               {7, 1, 1, 2, 2},
                                                               {7, 5, 7, 5, 7},
                                                               {7, 5, 7, 1, 7},
                                                               {0, 0, 7, 0, 0}}};

std::size_t offset(const RgbImage& image, int x, int y) {
  return (static_cast<std::size_t>(y) * static_cast<std::size_t>(image.width) +
          static_cast<std::size_t>(x)) *
         3;
}

void draw_number(RgbImage& sheet, int x, int y, int right, int number) {
  for (const char c : std::to_string(number)) {
    const auto& glyph = kGlyphs[c == '-' ? 10U : static_cast<unsigned>(c - '0')];
    if (x + 3 * kDot > right) return;
    for (int dy = 0; dy < 5 * kDot; ++dy) {
      for (int dx = 0; dx < 3 * kDot; ++dx) {
        const bool set = (glyph[static_cast<std::size_t>(dy / kDot)] >> (2 - dx / kDot) & 1) != 0;
        if (!set) continue;
        std::fill_n(
            sheet.pixels.begin() + static_cast<std::ptrdiff_t>(offset(sheet, x + dx, y + dy)), 3,
            kInk);
      }
    }
    x += 4 * kDot;
  }
}

}  // namespace

RgbImage contact_sheet(std::span<const RgbImage> pictures, std::span<const int> frames,
                       int columns) {
  assert(!pictures.empty() && pictures.size() == frames.size() && columns > 0);
  const int count = static_cast<int>(pictures.size());
  columns = std::min(columns, count);
  const int rows = (count + columns - 1) / columns;
  const int width = pictures.front().width, height = pictures.front().height;
  RgbImage sheet{kGap + columns * (width + kGap), kGap + rows * (height + kLabelHeight + kGap), {}};
  sheet.pixels.assign(offset(sheet, 0, sheet.height), kPaper);
  for (int i = 0; i < count; ++i) {
    const RgbImage& picture = pictures[static_cast<std::size_t>(i)];
    assert(picture.width == width && picture.height == height);
    const int x = kGap + (i % columns) * (width + kGap);
    const int y = kGap + (i / columns) * (height + kLabelHeight + kGap);
    for (int row = 0; row < height; ++row) {
      std::copy_n(picture.pixels.begin() + static_cast<std::ptrdiff_t>(offset(picture, 0, row)),
                  width * 3,
                  sheet.pixels.begin() + static_cast<std::ptrdiff_t>(offset(sheet, x, y + row)));
    }
    draw_number(sheet, x, y + height + 4, x + width, frames[static_cast<std::size_t>(i)]);
  }
  return sheet;
}

std::vector<int> spread_evenly(std::span<const int> frames, int count) {
  const auto total = static_cast<int>(frames.size());
  if (total <= count) return {frames.begin(), frames.end()};
  std::vector<int> chosen;
  for (int i = 0; i < count; ++i) {
    const int at = count == 1 ? 0 : static_cast<int>(std::int64_t{i} * (total - 1) / (count - 1));
    chosen.push_back(frames[static_cast<std::size_t>(at)]);
  }
  return chosen;
}

}  // namespace raystage
