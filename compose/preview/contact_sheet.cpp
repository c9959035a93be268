// SPDX-License-Identifier: Apache-2.0
#include "compose/preview/contact_sheet.h"

#include <algorithm>
#include <cassert>
#include <cstdint>
#include <string>

#include "compose/preview/digits.h"

namespace raystage {
namespace {

constexpr int kGap = 8, kLabelHeight = 16, kDot = 2;
constexpr std::uint8_t kPaper = 38;

std::size_t offset(const RgbImage& image, int x, int y) {
  return (static_cast<std::size_t>(y) * static_cast<std::size_t>(image.width) +
          static_cast<std::size_t>(x)) *
         3;
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
    draw_digits(std::to_string(frames[static_cast<std::size_t>(i)]), x, y + height + 4, x + width,
                kDot, sheet);
  }
  return sheet;
}

std::vector<int> evenly_spaced_frames(std::span<const int> frames, int count) {
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
