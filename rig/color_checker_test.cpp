// SPDX-License-Identifier: Apache-2.0
#include "rig/color_checker.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "base/transfer_function.h"

namespace raystage::rig {
namespace {

/// Returns sRGB codes, 0 to 255.
std::array<double, 3> codes_of(const schemas::Rgb& light) {
  std::array<double, 3> codes{};
  for (std::size_t c = 0; c < 3; ++c) {
    codes[c] = 255 * srgb_from_linear(std::clamp(light[c], 0.0, 1.0));
  }
  return codes;
}

TEST(ColorChecker, IsNearToTheMakersCodesOfOlderCharts) {
  // X-Rite's sRGB codes of charts made before November 2014; saturated colours differ most.
  constexpr std::array<std::array<double, 3>, kChartPatches> kPublished{{
      {115, 82, 68},   {194, 150, 130}, {98, 122, 157}, {87, 108, 67},   {133, 128, 177},
      {103, 189, 170}, {214, 126, 44},  {80, 91, 166},  {193, 90, 99},   {94, 60, 108},
      {157, 188, 64},  {224, 163, 46},  {56, 61, 150},  {70, 148, 73},   {175, 54, 60},
      {231, 199, 31},  {187, 86, 149},  {8, 133, 161},  {243, 243, 242}, {200, 200, 200},
      {160, 160, 160}, {122, 122, 121}, {85, 85, 85},   {52, 52, 52},
  }};
  const PatchColors light = color_checker_reference();
  double sum = 0;
  for (std::size_t patch = 0; patch < kPublished.size(); ++patch) {
    const auto codes = codes_of(light[patch]);
    for (std::size_t c = 0; c < 3; ++c) {
      const double off = std::abs(codes[c] - kPublished[patch][c]);
      EXPECT_LE(off, patch < kFirstNeutralPatch ? 18 : 8) << patch;
      sum += off;
    }
  }
  EXPECT_LE(sum / (3 * kChartPatches), 4);
}

TEST(ColorChecker, ReflectsAsMuchAsItsLightnessSays) {
  // The adaptation maps white to white: L* 95.19 is a luminance of 0.8806.
  const schemas::Rgb white = color_checker_reference()[kFirstNeutralPatch];
  EXPECT_NEAR(0.2126 * white[0] + 0.7152 * white[1] + 0.0722 * white[2], 0.8806, 0.002);
}

TEST(ColorChecker, GreysAreGreyAndFallInEvenSteps) {
  const PatchColors light = color_checker_reference();
  for (std::size_t i = kFirstNeutralPatch; i < light.size(); ++i) {
    EXPECT_NEAR(light[i][0], light[i][1], 0.04 * light[i][1]);
    EXPECT_NEAR(light[i][2], light[i][1], 0.06 * light[i][1]);
    if (i == kFirstNeutralPatch) continue;
    EXPECT_LT(light[i][1], 0.75 * light[i - 1][1]);
  }
  EXPECT_LT(light[17][0], 0);  // cyan is outside Rec.709
}

}  // namespace
}  // namespace raystage::rig
