// SPDX-License-Identifier: Apache-2.0
// For tests: pictures of cameras.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "store/jpeg/encode.h"

namespace raystage::testing {

/// Returns a gradient whose brightness depends on `shade`. Its chroma varies slowly, so that chroma
/// subsampling changes it little.
inline store::RgbImage test_picture(int width, int height, int shade) {
  store::RgbImage image{width, height, std::vector<std::uint8_t>()};
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      image.values.push_back(static_cast<std::uint8_t>(shade / 2 + 100 * x / width));
      image.values.push_back(static_cast<std::uint8_t>(shade / 2 + 100 * y / height));
      image.values.push_back(static_cast<std::uint8_t>(shade));
    }
  }
  return image;
}

inline std::vector<std::byte> test_jpeg(int width, int height, int shade) {
  return store::encode_jpeg(test_picture(width, height, shade), {});
}

}  // namespace raystage::testing
