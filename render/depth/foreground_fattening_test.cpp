// SPDX-License-Identifier: Apache-2.0
// Bars in front of a plain wall: between them the depths of the bars and of the wall match alike.
// See camera_depths_test.cpp for the comparison with the reference.
#include "render/depth/foreground_fattening.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "testing/render/test_depth_kernels.h"

namespace raystage::render {
namespace {

using testing::camera_at;
using testing::kHeight;
using testing::kWidth;

constexpr float kBarDepth = 0.5F, kPlainWall = 0.2F;  // inverse depths, 1/m
constexpr double kPerPixel = 0.02;

using Colour = std::array<int, 3>;  // codes of 255
constexpr Colour kGreen{60, 120, 60}, kRed{180, 64, 60}, kWhite{240, 240, 240};

MatchingImage image_of(const VirtualCamera& camera, const std::function<Colour(int, int)>& colour) {
  store::DecodedFrame frame;
  frame.width = camera.width;
  frame.height = camera.height;
  frame.rgba = std::make_unique<std::uint16_t[]>(4 * static_cast<std::size_t>(kWidth * kHeight));
  for (int i = 0; i < kWidth * kHeight; ++i) {
    const Colour code = colour(i % kWidth, i / kWidth);
    for (int c = 0; c < 3; ++c) frame.rgba[4 * i + c] = static_cast<std::uint16_t>(257 * code[c]);
  }
  schemas::CameraGeometry geometry{"c", kWidth, kHeight, camera.intrinsics, {}, {}, {}};
  return {frame,
          {store::BlendSpace::kPerceptual, 1},
          {"c", rig::CameraModel(geometry), camera.pose, {}, {}, {}},
          camera};
}

/// A picture with a plain middle between bars, which took the bars' depth; the wall is around.
class Gap : public ::testing::Test {
 protected:
  static constexpr int kLeft = 20, kRight = 28;  // bars, 2 pixels wide
  static bool is_bar(int x) {
    return (x >= kLeft && x < kLeft + 2) || (x >= kRight && x < kRight + 2);
  }
  static bool is_gap(int x) { return x >= kLeft + 2 && x < kRight; }

  InverseDepthMap corrected(const Colour& gap, const Colour& wall, const Colour& of_neighbours) {
    const MatchingImage own = image_of(own_, [&](int x, int) {
      return is_bar(x) ? kWhite : is_gap(x) ? gap : wall;
    });
    const MatchingImage other = image_of(other_, [&](int, int) { return of_neighbours; });
    const NeighbourView neighbour{pixel_transfer(other_, own_), &other, nullptr};
    InverseDepthMap map(kWidth, kHeight);
    for (int i = 0; i < kWidth * kHeight; ++i) {
      const int x = i % kWidth;
      map.values[i] = is_bar(x) || is_gap(x) ? kBarDepth : kPlainWall;
    }
    return reduce_foreground_fattening(map, own, std::span(&neighbour, 1), kPerPixel,
                                       fattening_reach(kWidth));
  }
  static constexpr int kMiddle = (kLeft + kRight) / 2;

  VirtualCamera own_ = camera_at({0, 0, 0}, 0), other_ = camera_at({0.1, 0, 0}, 0);
};

TEST_F(Gap, TakesTheDepthOfTheWallOfItsColour) {
  const InverseDepthMap map = corrected(kGreen, kGreen, kGreen);
  EXPECT_EQ(map.at(kMiddle, kHeight / 2), kPlainWall);
  EXPECT_EQ(map.at(kLeft, kHeight / 2), kBarDepth) << "the bars have another colour";
  EXPECT_EQ(map.at(kRight + 1, kHeight / 2), kBarDepth);
}

TEST_F(Gap, OfAnotherColourStays) {
  const double difference = 0.299 * 180 + 0.587 * 64 - (0.299 * 60 + 0.587 * 120);
  ASSERT_LT(std::abs(difference), foreground_fattening::kSameColour) << "luma is the same";
  EXPECT_EQ(corrected(kRed, kGreen, kGreen).at(kMiddle, kHeight / 2), kBarDepth);
}

// Where the neighbours see the gap at the depth of the bars only, it is a surface there.
TEST_F(Gap, ThatTheNeighboursContradictStays) {
  const MatchingImage own = image_of(own_, [&](int x, int) { return is_bar(x) ? kWhite : kGreen; });
  // The neighbour shows the gap moved as the bars are, and white elsewhere.
  const VirtualCamera far = camera_at({0.5, 0, 0}, 0);
  const PixelTransfer transfer = pixel_transfer(far, own_);
  const MatchingImage other = image_of(far, [&](int x, int) {
    const double shift = kBarDepth * transfer.parallax[0] / transfer.direction[8];
    const double there = x - shift;
    return there >= kLeft + 1 && there < kRight + 1 ? kGreen : kWhite;
  });
  const NeighbourView neighbour{transfer, &other, nullptr};
  InverseDepthMap map(kWidth, kHeight);
  for (int i = 0; i < kWidth * kHeight; ++i) {
    const int x = i % kWidth;
    map.values[i] = is_bar(x) || is_gap(x) ? kBarDepth : kPlainWall;
  }
  const double apart =
      (kBarDepth - kPlainWall) * std::abs(transfer.parallax[0] / transfer.direction[8]);
  ASSERT_GT(apart, kRight - kLeft) << "at the wall's depth the neighbour shows other pixels";
  const InverseDepthMap found = reduce_foreground_fattening(map, own, std::span(&neighbour, 1),
                                                            kPerPixel, fattening_reach(kWidth));
  EXPECT_EQ(found.at(kMiddle, kHeight / 2), kBarDepth);
}

TEST_F(Gap, UnknownDepthsStayAndAreNoBackground) {
  const MatchingImage plain = image_of(own_, [](int, int) { return kGreen; });
  const NeighbourView neighbour{pixel_transfer(own_, own_), &plain, nullptr};
  InverseDepthMap map(kWidth, kHeight, kUnknownDepth);
  map.at(5, 5) = kBarDepth;
  EXPECT_EQ(reduce_foreground_fattening(map, plain, std::span(&neighbour, 1), kPerPixel,
                                        fattening_reach(kWidth))
                .values,
            map.values);
  EXPECT_EQ(reduce_foreground_fattening(map, plain, {}, kPerPixel, fattening_reach(kWidth)).values,
            map.values);
}

}  // namespace
}  // namespace raystage::render
