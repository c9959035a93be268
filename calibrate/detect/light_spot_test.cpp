// SPDX-License-Identifier: Apache-2.0
#include "calibrate/detect/light_spot.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <random>

#include "base/transfer_function.h"

namespace raystage::calibrate {
namespace {

using Eigen::Vector2d;

struct Disc {
  Vector2d centre;
  double radius = 3, light = 0.8;
};

/// Returns a dark picture with discs of light (box-filtered to pixels) and a little noise.
store::RgbImage dark_room(const std::vector<Disc>& discs, double room = 0.002) {
  store::RgbImage image(160, 120);
  std::mt19937 random(4);
  std::normal_distribution<double> noise(0, 0.0008);
  for (int i = 0; i < 160 * 120; ++i) {
    const int x = i % 160, y = i / 160;
    double light = room + noise(random);
    for (const Disc& disc : discs) {
      constexpr int kSide = 8;
      for (int k = 0; k < kSide * kSide; ++k) {
        const int across = k % kSide, down = k / kSide;
        const Vector2d at(x + (across + 0.5) / kSide, y + (down + 0.5) / kSide);
        if ((at - disc.centre).norm() < disc.radius) light += disc.light / (kSide * kSide);
      }
    }
    const auto code =
        static_cast<std::uint8_t>(std::lround(255 * srgb_from_linear(std::clamp(light, 0.0, 1.0))));
    std::fill_n(image.values.begin() + 3 * i, 3, code);
  }
  return image;
}

std::array<float, 256> linear_from_code(bool is_srgb = true) {
  std::array<float, 256> light{};
  for (std::size_t i = 0; i < light.size(); ++i) {
    const double code = static_cast<double>(i) / 255;
    light[i] = static_cast<float>(is_srgb ? linear_from_srgb(code) : code);
  }
  return light;
}

LightSpot found_in(const std::vector<Disc>& discs, double room = 0.002) {
  const std::vector<store::RgbImage> empty{dark_room({}, room)};
  return detect_light(dark_room(discs, room), LightBackground(empty, linear_from_code()), {});
}

TEST(LightSpots, AreFoundToATwentiethOfAPixel) {
  std::mt19937 random(9);
  std::uniform_real_distribution<double> place(20, 90), radius(1.2, 4.5);
  for (int i = 0; i < 40; ++i) {
    const Disc disc{{place(random), place(random)}, radius(random), 0.8};
    const LightSpot spot = found_in({disc});
    ASSERT_EQ(spot.result, LightDetectionStatus::kFound);
    EXPECT_LE((spot.centre - disc.centre).norm(), 0.05) << disc.radius;
  }
}

TEST(LightSpots, AreAsBrightAsTheTakesCodesSay) {
  // Code 99 is 1/8 of full scale as sRGB, and 2/5 as linear light.
  std::vector<store::RgbImage> empty{dark_room({})};
  store::RgbImage picture = empty.front();
  for (const int y : {60, 61, 62}) {
    for (const int x : {80, 81, 82}) {
      std::fill_n(picture.values.begin() + 3 * (160 * y + x), 3, std::uint8_t{99});
    }
  }
  LightDetectionOptions options;
  options.min_light = 0.25;
  const auto result_by = [&](bool is_srgb) {
    return detect_light(picture, LightBackground(empty, linear_from_code(is_srgb)), options).result;
  };
  EXPECT_EQ(result_by(true), LightDetectionStatus::kDark);
  EXPECT_EQ(result_by(false), LightDetectionStatus::kFound);
}

TEST(LightSpots, AreFoundBeforeABrightRoom) {
  const Disc disc{{50.3, 60.8}, 3, 0.5};
  const LightSpot spot = found_in({disc}, 0.3);
  ASSERT_EQ(spot.result, LightDetectionStatus::kFound);
  EXPECT_LE((spot.centre - disc.centre).norm(), 0.05);
}

TEST(LightSpots, AreLeftOutWhereTheyCannotBeTrusted) {
  EXPECT_EQ(found_in({}).result, LightDetectionStatus::kDark);
  EXPECT_EQ(found_in({{{50, 50}, 3, 0.02}}).result, LightDetectionStatus::kDark);
  // A reflection of the same size and half the brightness is ambiguous; a weaker one is not.
  EXPECT_EQ(found_in({{{50, 50}, 3, 0.8}, {{90, 70}, 3, 0.4}}).result,
            LightDetectionStatus::kAmbiguous);
  EXPECT_EQ(found_in({{{50, 50}, 3, 0.8}, {{90, 70}, 2, 0.3}}).result,
            LightDetectionStatus::kFound);
  EXPECT_EQ(found_in({{{50, 50}, 12, 0.8}}).result, LightDetectionStatus::kTooLarge);
  EXPECT_EQ(found_in({{{1, 50}, 3, 0.8}}).result, LightDetectionStatus::kAtBorder);
  EXPECT_EQ(found_in({{{50, 50}, 4, 1.5}}).result, LightDetectionStatus::kSaturated);
  EXPECT_EQ(found_in({{{50, 50}, 1.5, 1.5}}).result, LightDetectionStatus::kFound);
}

TEST(LightBackgrounds, KnowNothingOfAMovingLight) {
  std::vector<store::RgbImage> pictures;
  for (int i = 0; i < 9; ++i) pictures.push_back(dark_room({{{20.0 + 12 * i, 50}, 3, 0.8}}));
  const LightBackground background(pictures, linear_from_code());
  EXPECT_LE(*std::ranges::max_element(background.light()), 0.02F);
}

}  // namespace
}  // namespace raystage::calibrate
