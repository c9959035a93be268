// SPDX-License-Identifier: Apache-2.0
#include "images/resize.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>

namespace raystage::images {
namespace {

store::RgbImage noise(int width, int height) {
  store::RgbImage image(width, height);
  std::uint32_t state = 1;
  for (std::uint8_t& value : image.values) {
    state = state * 1664525 + 1013904223;
    value = static_cast<std::uint8_t>(state >> 24);
  }
  return image;
}

// The mean over the area that a pixel covers, with the shares of pixels at its border.
double mean_over_area(const store::RgbImage& image, double x0, double x1, double y0, double y1,
                      int channel) {
  double sum = 0;
  for (int y = static_cast<int>(y0); y < std::min(image.height, static_cast<int>(std::ceil(y1)));
       ++y) {
    for (int x = static_cast<int>(x0); x < std::min(image.width, static_cast<int>(std::ceil(x1)));
         ++x) {
      const double share = (std::min(x1, x + 1.0) - std::max(x0, double(x))) *
                           (std::min(y1, y + 1.0) - std::max(y0, double(y)));
      sum += share * image.values[(static_cast<std::size_t>(y) * image.width + x) * 3 + channel];
    }
  }
  return sum / ((x1 - x0) * (y1 - y0));
}

TEST(Resize, PixelsOfASmallerImageAreMeansOfWhatTheyCover) {
  const store::RgbImage image = noise(64, 48);
  for (const auto& [width, height] : {std::pair{32, 24}, {21, 17}, {64, 9}, {1, 1}}) {
    const store::RgbImage smaller = resize(image, width, height);
    ASSERT_EQ(smaller.width, width);
    ASSERT_EQ(smaller.height, height);
    const double sx = 64.0 / width;
    const double sy = 48.0 / height;
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        for (int c = 0; c < 3; ++c) {
          EXPECT_NEAR(smaller.values[(static_cast<std::size_t>(y) * width + x) * 3 + c],
                      mean_over_area(image, x * sx, (x + 1) * sx, y * sy, (y + 1) * sy, c), 1.01)
              << x << " " << y << " of " << width << "x" << height;
        }
      }
    }
  }
}

TEST(Resize, ALargerImageIsInterpolatedAndNeverOvershoots) {
  store::RgbImage image(2, 1);
  std::fill_n(image.values.begin() + 3, 3, std::uint8_t{200});
  const store::RgbImage larger = resize(image, 8, 3);
  std::uint8_t previous = 0;
  for (std::size_t x = 0; x < 8; ++x) {
    const std::uint8_t value = larger.values[x * 3];
    EXPECT_NEAR(value, 200 * std::clamp((static_cast<double>(x) + 0.5) / 4 - 0.5, 0.0, 1.0), 1.01);
    EXPECT_GE(value, previous);
    previous = value;
  }
}

}  // namespace
}  // namespace raystage::images
