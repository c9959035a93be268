// SPDX-License-Identifier: Apache-2.0
#include "rig/color_checker.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "schemas/transfer_function.h"

namespace raystage {
namespace {

/// Codes of sRGB, 0 to 255.
std::array<double, 3> codes_of(const Rgb& light) {
  std::array<double, 3> codes{};
  for (std::size_t c = 0; c < 3; ++c) {
    codes[c] = 255 * srgb_from_linear(std::clamp(light[c], 0.0, 1.0));
  }
  return codes;
}

TEST(ColorChecker, IsNearToTheMakersCodesOfOlderCharts) {
  // X-Rite's sRGB codes of charts made before November 2014; saturated colours differ most.
  const auto expect = [](int patch, const std::array<double, 3>& published, double within) {
    const auto codes = codes_of(color_checker_light()[static_cast<std::size_t>(patch)]);
    for (std::size_t c = 0; c < 3; ++c) EXPECT_NEAR(codes[c], published[c], within) << patch;
  };
  expect(0, {115, 82, 68}, 4);
  expect(1, {194, 150, 130}, 7);
  expect(3, {87, 108, 67}, 7);
  expect(12, {56, 61, 150}, 17);
  expect(13, {70, 148, 73}, 10);
  expect(14, {175, 54, 60}, 8);
  expect(15, {231, 199, 31}, 17);
  expect(18, {243, 243, 242}, 8);
  expect(21, {122, 122, 121}, 2);
  expect(23, {52, 52, 52}, 3);
}

TEST(ColorChecker, ReflectsAsMuchAsItsLightnessSays) {
  // White for white, whatever it is adapted to: L* 95.19 is a luminance of 0.8806.
  const Rgb white = color_checker_light()[kFirstGrey];
  EXPECT_NEAR(0.2126 * white[0] + 0.7152 * white[1] + 0.0722 * white[2], 0.8806, 0.002);
}

TEST(ColorChecker, GreysAreGreyAndFallInEvenSteps) {
  const ChartLight light = color_checker_light();
  for (std::size_t i = kFirstGrey; i < light.size(); ++i) {
    EXPECT_NEAR(light[i][0], light[i][1], 0.04 * light[i][1]);
    EXPECT_NEAR(light[i][2], light[i][1], 0.06 * light[i][1]);
    if (i == kFirstGrey) continue;
    EXPECT_LT(light[i][1], 0.75 * light[i - 1][1]);
  }
  EXPECT_LT(light[17][0], 0);  // cyan is out of Rec.709's reach
}

}  // namespace
}  // namespace raystage
