// SPDX-License-Identifier: Apache-2.0
#include "compose/preview/contact_sheet.h"

#include <algorithm>
#include <cassert>
#include <cstdint>
#include <string>

#include "compose/preview/digits.h"

namespace raystage::compose {
namespace {

constexpr int kGap = 8, kLabelHeight = 16, kDot = 2;
constexpr std::uint8_t kPaper = 38;

std::size_t offset(const store::RgbImage& image, int x, int y) {
  return (static_cast<std::size_t>(y) * image.width + x) * 3;
}

}  // namespace

store::RgbImage contact_sheet(std::span<const store::RgbImage> pictures,
                              std::span<const int> frames, int columns) {
  assert(!pictures.empty() && pictures.size() == frames.size() && columns > 0);
  const int count = static_cast<int>(pictures.size());
  columns = std::min(columns, count);
  const int rows = (count + columns - 1) / columns;
  const int width = pictures.front().width, height = pictures.front().height;
  store::RgbImage sheet{kGap + columns * (width + kGap),
                        kGap + rows * (height + kLabelHeight + kGap), std::vector<std::uint8_t>()};
  sheet.values.assign(offset(sheet, 0, sheet.height), kPaper);
  for (int i = 0; i < count; ++i) {
    const store::RgbImage& picture = pictures[i];
    assert(picture.width == width && picture.height == height);
    const int x = kGap + (i % columns) * (width + kGap);
    const int y = kGap + (i / columns) * (height + kLabelHeight + kGap);
    for (int row = 0; row < height; ++row) {
      std::copy_n(picture.values.begin() + offset(picture, 0, row), width * 3,
                  sheet.values.begin() + offset(sheet, x, y + row));
    }
    draw_digits(std::to_string(frames[i]), x, y + height + 4, x + width, kDot, sheet);
  }
  return sheet;
}

std::vector<int> evenly_spaced_frames(std::span<const int> frames, int count) {
  const auto total = static_cast<int>(frames.size());
  if (total <= count) return {frames.begin(), frames.end()};
  std::vector<int> chosen;
  for (int i = 0; i < count; ++i) {
    const int at = count == 1 ? 0 : static_cast<int>(std::int64_t{i} * (total - 1) / (count - 1));
    chosen.push_back(frames[at]);
  }
  return chosen;
}

}  // namespace raystage::compose
