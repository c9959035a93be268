// SPDX-License-Identifier: Apache-2.0
#include "render/depth/temporal_filter.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <random>

namespace raystage::render::temporal_filter_test {
namespace {

constexpr int kWidth = 37, kHeight = 23;
constexpr float kTolerance = 0.05F;

MatchingImage picture(const std::function<int(int, int)>& luma) {
  store::DecodedFrame frame;
  frame.width = kWidth;
  frame.height = kHeight;
  frame.rgba = std::make_unique<std::uint16_t[]>(std::size_t{4} * kWidth * kHeight);
  for (int i = 0; i < kWidth * kHeight; ++i) {
    const int code = luma(i % kWidth, i / kWidth) * 257;
    for (int c = 0; c < 3; ++c) frame.rgba[4 * i + c] = static_cast<std::uint16_t>(code);
  }
  schemas::CameraGeometry geometry;
  geometry.id = "c";
  geometry.width = kWidth;
  geometry.height = kHeight;
  geometry.intrinsics = {30, 30, kWidth / 2.0, kHeight / 2.0, {}};
  const rig::CameraModel model(geometry);
  return {
      frame, store::BlendSpace::kPerceptual, {"c", model, {}, {}, {}, {}}, undistorted(model, {})};
}

InverseDepthMap map_of(const std::function<float(int, int)>& depth) {
  InverseDepthMap map(kWidth, kHeight);
  for (int i = 0; i < kWidth * kHeight; ++i) {
    map.at(i % kWidth, i / kWidth) = depth(i % kWidth, i / kWidth);
  }
  return map;
}

TEST(Temporal, AgreesWithTheReference) {
  std::mt19937 random(1);
  const auto noisy = [&](int x, int) {
    return 100 + static_cast<int>(random() % (x < 20 ? 4 : 9));
  };
  const auto depth = [&](int, int) {
    return random() % 7 == 0 ? kUnknownDepth : 0.3F + 0.0001F * static_cast<float>(random() % 900);
  };
  const MatchingImage now = picture(noisy), before = picture(noisy), after = picture(noisy);
  const InverseDepthMap depths = map_of(depth), earlier = map_of(depth), later = map_of(depth);
  const std::vector<TemporalNeighbour> others{{&before, &earlier}, {&after, &later}};
  const InverseDepthMap fast = temporal_filter(depths, now, others, kTolerance);
  const InverseDepthMap slow = temporal_filter_reference(depths, now, others, kTolerance);
  int changed = 0;
  for (std::size_t i = 0; i < slow.values.size(); ++i) {
    ASSERT_NEAR(fast.values[i], slow.values[i], 1e-5) << i;
    changed += std::abs(slow.values[i] - depths.values[i]) > 1e-4F ? 1 : 0;
  }
  EXPECT_GT(changed, kWidth * kHeight / 4);
}

TEST(Temporal, SteadiesWhatStandsStillAndLeavesAloneWhatMoves) {
  const MatchingImage now = picture([](int x, int y) { return 50 + (7 * x + 13 * y) % 100; });
  const MatchingImage then =
      picture([](int x, int y) { return 50 + (7 * (x > 18 ? x + 3 : x) + 13 * y) % 100; });
  const InverseDepthMap depths = map_of([](int, int) { return 0.40F; });
  const InverseDepthMap other = map_of([](int, int) { return 0.41F; });
  const InverseDepthMap elsewhere = map_of([](int, int) { return 0.60F; });
  const std::vector<TemporalNeighbour> close{{&then, &other}}, far{{&then, &elsewhere}};
  const InverseDepthMap mixed = temporal_filter(depths, now, close, kTolerance);
  EXPECT_NEAR(mixed.at(8, 11), (0.40 + 0.8 * 0.41) / 1.8, 1e-5);
  EXPECT_EQ(mixed.at(28, 11), 0.40F);                                         // moved
  EXPECT_EQ(temporal_filter(depths, now, far, kTolerance).at(8, 11), 0.40F);  // another depth
}

}  // namespace
}  // namespace raystage::render::temporal_filter_test
