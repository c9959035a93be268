// SPDX-License-Identifier: Apache-2.0
#include "compose/preview/digits.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>

namespace raystage::compose {
namespace {

constexpr std::uint8_t kInk = 220, kBar = 20;
constexpr int kColumns = 3, kRows = 5;

/// Digits of 3 x 5 dots, three bits per row from the top; then minus sign, colon and space.
constexpr std::array<std::array<std::uint8_t, 5>, 13> kGlyphs{{{7, 5, 5, 5, 7},
                                                               {2, 6, 2, 2, 7},
                                                               {7, 1, 7, 4, 7},
                                                               {7, 1, 7, 1, 7},
                                                               {5, 5, 7, 1, 1},
                                                               {7, 4, 7, 1, 7},
                                                               {7, 4, 7, 5, 7},
                                                               {7, 1, 1, 2, 2},
                                                               {7, 5, 7, 5, 7},
                                                               {7, 5, 7, 1, 7},
                                                               {0, 0, 7, 0, 0},
                                                               {0, 2, 0, 2, 0},
                                                               {0, 0, 0, 0, 0}}};

const std::array<std::uint8_t, kRows>& glyph_of(char c) {
  if (c >= '0' && c <= '9') return kGlyphs[c - '0'];
  return kGlyphs[c == '-' ? 10 : c == ':' ? 11 : 12];
}

void fill(store::RgbImage& picture, int left, int right, int y, std::uint8_t value) {
  const auto at = [&](int x) {
    return picture.values.begin() + (static_cast<std::ptrdiff_t>(y) * picture.width + x) * 3;
  };
  std::fill(at(left), at(right), value);
}

}  // namespace

void draw_digits(std::string_view text, int x, int y, int right, int dot,
                 store::RgbImage& picture) {
  for (const char c : text) {
    if (x + kColumns * dot > right) return;
    for (int row = 0; row < kRows * dot; ++row) {
      for (int column = 0; column < kColumns; ++column) {
        const int bits = glyph_of(c)[row / dot];
        const int left = x + column * dot;
        if ((bits >> (kColumns - 1 - column) & 1) != 0) {
          fill(picture, left, left + dot, y + row, kInk);
        }
      }
    }
    x += (kColumns + 1) * dot;
  }
}

void burn_in(std::string_view text, store::RgbImage& picture) {
  const int dot = std::max(1, picture.height / 180);
  const int height = (kRows + 2) * dot;
  if (picture.height < height) return;
  const int width =
      std::min(picture.width, static_cast<int>(text.size()) * (kColumns + 1) * dot + dot);
  const int top = picture.height - height;
  for (int y = top; y < picture.height; ++y) fill(picture, 0, width, y, kBar);
  draw_digits(text, dot, top + dot, width, dot, picture);
}

}  // namespace raystage::compose
