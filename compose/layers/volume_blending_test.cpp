// SPDX-License-Identifier: Apache-2.0
#include "compose/layers/volume_blending.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

namespace raystage::compose {
namespace {

using Eigen::Vector3d;
using Seen = std::array<float, 4>;
using ::testing::ElementsAre;

/// Sides of a box without floor and ceiling: front, right, back, left.
const std::vector<Vector3d> kAround{-Vector3d::UnitZ(), Vector3d::UnitX(), Vector3d::UnitZ(),
                                    -Vector3d::UnitX()};
constexpr Seen kNothing{0, 0, 0, 0}, kRed{1, 0, 0, 1}, kGreen{0, 1, 0, 1}, kBlue{0, 0, 1, 1};

/// Returns the direction at `degrees` to the right of the front.
Vector3d towards(double degrees) {
  const double angle = degrees * std::numbers::pi / 180;
  return {std::sin(angle), 0, -std::cos(angle)};
}

TEST(VolumeBlender, ATakeAnswersWhatItFaces) {
  VolumeBlender blender(kAround);
  blender.find(7 * towards(0));
  EXPECT_THAT(blender.weights(), ElementsAre(1, 0, 0, 0));
  blender.find(towards(45 - kBlendWidthDegrees / 2 - 0.01));
  EXPECT_THAT(blender.weights(), ElementsAre(1, 0, 0, 0));
  blender.find(towards(45 + kBlendWidthDegrees / 2 + 0.01));
  EXPECT_THAT(blender.weights(), ElementsAre(0, 1, 0, 0));
  blender.find(towards(45));
  EXPECT_NEAR(blender.weights()[0], 0.5, 1e-6);
  EXPECT_NEAR(blender.weights()[1], 0.5, 1e-6);
}

TEST(VolumeBlender, SharesSumToOneAndNeverJump) {
  VolumeBlender blender(kAround);
  std::vector<float> before;
  constexpr double kStep = 0.01;
  for (double degrees = 0; degrees < 360; degrees += kStep) {
    blender.find(towards(degrees) + 0.3 * Vector3d::UnitY());
    float sum = 0;
    for (std::size_t i = 0; i < 4; ++i) {
      const float share = blender.weights()[i];
      sum += share;
      if (!before.empty()) {
        EXPECT_NEAR(share, before[i], 2.5 * kStep / kBlendWidthDegrees) << degrees;
      }
    }
    EXPECT_NEAR(sum, 1, 1e-6);
    before.assign(blender.weights().begin(), blender.weights().end());
  }
}

TEST(VolumeBlender, InEveryDirectionOfABoxTheShareIsThatOfItsNearestSide) {
  std::vector<Vector3d> box = kAround;
  box.push_back(Vector3d::UnitY());
  box.push_back(-Vector3d::UnitY());
  VolumeBlender blender(box);
  for (const Vector3d& corner : {Vector3d(1, 1, 1), Vector3d(-1, 1, -1), Vector3d(1, -1, -1)}) {
    blender.find(corner);
    int thirds = 0;
    for (const float share : blender.weights()) thirds += std::abs(share - 1.0F / 3) < 1e-5F;
    EXPECT_EQ(thirds, 3) << corner.transpose();
  }
}

TEST(VolumeBlender, WhereOneSawNothingTheOthersDo) {
  VolumeBlender blender(kAround);
  blender.find(towards(10));
  EXPECT_EQ(blender.blend(std::vector{kRed, kGreen, kBlue, kNothing}), kRed);
  EXPECT_EQ(blender.blend(std::vector{kNothing, kGreen, kBlue, kNothing}), kGreen);
  EXPECT_EQ(blender.dominant_take(std::vector{kNothing, kGreen, kBlue, kNothing}), 1U);
  EXPECT_EQ(blender.blend(std::vector{kNothing, kNothing, kNothing, kNothing}), kNothing);
  // Half of the alpha: the next take is behind.
  const Seen half{0.5F, 0, 0, 0.5F};
  EXPECT_EQ(blender.blend(std::vector{half, kGreen, kBlue, kNothing}), (Seen{0.5F, 0.5F, 0, 1}));
  // In the transition: neither mixed with rays that no camera saw, nor a hole.
  blender.find(towards(45));
  EXPECT_EQ(blender.blend(std::vector{kNothing, kGreen, kBlue, kNothing}), kGreen);
  const Seen mixed = blender.blend(std::vector{kRed, kGreen, kNothing, kNothing});
  EXPECT_NEAR(mixed[0], 0.5, 1e-6);
  EXPECT_NEAR(mixed[1], 0.5, 1e-6);
  for (double degrees = 43; degrees < 47; degrees += 0.01) {
    blender.find(towards(degrees));
    ASSERT_EQ(blender.blend(std::vector{kRed, kGreen, kNothing, kNothing})[3], 1) << degrees;
  }
}

render::VirtualCamera looking(double degrees, double fov_degrees, int width) {
  render::VirtualCamera camera;
  camera.width = width;
  camera.height = width / 2;
  const double focal = width / 2.0 / std::tan(fov_degrees * std::numbers::pi / 360);
  camera.intrinsics = {focal, focal, width / 2.0, width / 4.0, {}};
  camera.pose.world_from_camera_rotation =
      Eigen::AngleAxisd(-degrees * std::numbers::pi / 180, Vector3d::UnitY()).toRotationMatrix();
  return camera;
}

TEST(Volume, TakesThatAnswerNoPixelNeedNotBeAsked) {
  EXPECT_THAT(takes_in_view(kAround, looking(0, 60, 64)), ElementsAre(true, false, false, false));
  EXPECT_THAT(takes_in_view(kAround, looking(45, 60, 64)), ElementsAre(true, true, false, false));
  EXPECT_THAT(takes_in_view(kAround, looking(180, 120, 64)), ElementsAre(false, true, true, true));
}

LayerImage plain(const Seen& color, float z, float coverage) {
  LayerImage image = transparent_layer_image(64, 32);
  for (std::size_t i = 0; i < image.pixels(); ++i) {
    std::ranges::copy(color, &image.rgba[4 * i]);
    image.z[i] = z;
  }
  image.aovs.push_back({"lf", {"coverage"}, false, 0, {}});
  image.aovs[0].values.assign(image.pixels(), coverage);
  return image;
}

TEST(Volume, APictureIsPutTogetherFromWhatTheTakesFace) {
  const LayerImage ahead = plain(kRed, 3, 0.5F), right = plain(kGreen, 4, 1);
  const std::vector<const LayerImage*> takes{&ahead, &right, nullptr, nullptr};
  const LayerImage image = blend_volume(takes, kAround, looking(45, 60, 64));
  const auto at = [&](int x) { return static_cast<std::size_t>(16 * 64 + x); };
  EXPECT_EQ(image.rgba[4 * at(5)], 1);
  EXPECT_EQ(image.z[at(5)], 3);
  EXPECT_EQ(image.aovs[0].values[at(5)], 0.5F);
  EXPECT_EQ(image.rgba[4 * at(60) + 1], 1);
  EXPECT_EQ(image.z[at(60)], 4);
  EXPECT_EQ(image.aovs[0].values[at(60)], 1);
  for (std::size_t i = 0; i < image.pixels(); ++i) EXPECT_EQ(image.rgba[4 * i + 3], 1);
  // A take with a different direction leaves the rays transparent.
  const std::vector<const LayerImage*> none{nullptr, nullptr, nullptr, nullptr};
  const LayerImage open = blend_volume(none, kAround, looking(45, 60, 64));
  EXPECT_EQ(open.rgba[4 * at(5) + 3], 0);
  EXPECT_TRUE(std::isinf(open.z[at(5)]));
}

}  // namespace
}  // namespace raystage::compose
