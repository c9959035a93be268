// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <random>
#include <vector>

#include "store/jpeg/rgb_image.h"

namespace raystage::testing {

enum class Kind { kNoise, kGradient, kEdges, kMixed };

/// Returns a test picture: flat areas, saturated edges and noise, the same in every run.
inline store::RgbImage make(Kind kind, int width, int height, std::uint32_t seed = 1) {
  std::mt19937 random(seed);
  store::RgbImage image{width, height, std::vector<std::uint8_t>()};
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const std::uint32_t noise = random();
      const Kind here = kind != Kind::kMixed ? kind : static_cast<Kind>((x / 24 + y / 20) % 3);
      for (int c = 0; c < 3; ++c) {
        int value = 0;
        if (here == Kind::kNoise) value = static_cast<int>(noise >> (8 * c) & 255);
        if (here == Kind::kGradient)
          value = (x * (3 - c) + y * (1 + c)) * 255 / (3 * (width + height));
        if (here == Kind::kEdges) value = ((x + 2 * y + 5 * c) / 7 % 2) * 255;
        image.values.push_back(static_cast<std::uint8_t>(value));
      }
    }
  }
  return image;
}

inline std::vector<std::byte> read_bytes(const std::filesystem::path& file) {
  std::ifstream stream(file, std::ios::binary);
  const std::vector<char> chars{std::istreambuf_iterator<char>(stream), {}};
  std::vector<std::byte> bytes(chars.size());
  for (std::size_t i = 0; i < chars.size(); ++i) bytes[i] = static_cast<std::byte>(chars[i]);
  return bytes;
}

}  // namespace raystage::testing
