// SPDX-License-Identifier: Apache-2.0
#include "compose/layers/area_scaling.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numeric>

namespace raystage::compose {
namespace {

/// Returns an image whose values differ everywhere.
LayerImage ramp(int width, int height) {
  LayerImage image = transparent_layer_image(width, height);
  for (std::size_t i = 0; i < image.rgba.size(); ++i) {
    image.rgba[i] = static_cast<float>(std::sin(0.37 * static_cast<double>(i)) + 1);
  }
  std::iota(image.z.begin(), image.z.end(), 1.0F);
  return image;
}

TEST(AreaScaling, TheSameSizeIsTheSameImage) {
  const LayerImage image = ramp(7, 5);
  const LayerImage same = scale_down(image, {7, 5});
  EXPECT_EQ(same.rgba, image.rgba);
  EXPECT_EQ(same.z, image.z);
}

TEST(AreaScaling, APixelIsTheMeanOfItsArea) {
  const LayerImage image = ramp(8, 6);
  const LayerImage half = scale_down(image, {4, 3});
  for (int y = 0; y < 3; ++y) {
    for (int x = 0; x < 4; ++x) {
      for (int c = 0; c < 4; ++c) {
        const auto at = [&](int dx, int dy) {
          return image.rgba[4 * ((2 * y + dy) * 8 + 2 * x + dx) + c];
        };
        EXPECT_NEAR(half.rgba[4 * (y * 4 + x) + c], (at(0, 0) + at(1, 0) + at(0, 1) + at(1, 1)) / 4,
                    1e-6);
      }
      EXPECT_EQ(half.z[y * 4 + x], image.z[(2 * y + 1) * 8 + 2 * x + 1]);
    }
  }
}

TEST(AreaScaling, AnyRatioKeepsTheMean) {
  const LayerImage image = ramp(11, 9);
  const auto mean = [](const LayerImage& of) {
    return std::accumulate(of.rgba.begin(), of.rgba.end(), 0.0) /
           static_cast<double>(of.rgba.size());
  };
  for (const ImageSize size : {ImageSize{1, 1}, ImageSize{3, 2}, ImageSize{10, 7}}) {
    EXPECT_NEAR(mean(scale_down(image, size)), mean(image), 1e-5);
  }
}

}  // namespace
}  // namespace raystage::compose
