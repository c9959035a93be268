// SPDX-License-Identifier: Apache-2.0
#include "render/depth/temporal_filter.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <random>

#include "render/depth/temporal_motion.h"

namespace raystage::render::temporal_filter_test {
namespace {

constexpr int kWidth = 37, kHeight = 23;
constexpr float kTolerance = 0.05F;

Luma picture(const std::function<int(int, int)>& luma) {
  Luma made(kWidth, kHeight);
  for (int i = 0; i < kWidth * kHeight; ++i) {
    made.values[i] = static_cast<std::uint8_t>(luma(i % kWidth, i / kWidth));
  }
  return made;
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
  const Luma now = picture(noisy), before = picture(noisy), after = picture(noisy);
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
  const Luma now = picture([](int x, int y) { return 50 + (7 * x + 13 * y) % 100; });
  const Luma then =
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

// A square that moves by 3 pixels and 1, and its depths, which are noisy.
TEST(Temporal, FollowsWhatMoves) {
  constexpr int kSide = 96, kFirst = 30, kLast = 66;
  const auto square_at = [](int dx, int dy, float noise) {
    PictureWithDepths made{Luma(kSide, kSide), InverseDepthMap(kSide, kSide)};
    for (int y = 0; y < kSide; ++y) {
      for (int x = 0; x < kSide; ++x) {
        const int u = x - dx, v = y - dy;
        const bool is_square = u >= kFirst && u < kLast && v >= kFirst && v < kLast;
        const double code = is_square ? 130 + 60 * std::sin(0.35 * u) * std::cos(0.3 * v)
                                      : 90 + 50 * std::sin(0.2 * x + 0.27 * y);
        made.luma.at(x, y) = static_cast<std::uint8_t>(code);
        made.depths.at(x, y) = (is_square ? 0.4F : 0.2F) + noise;
      }
    }
    return made;
  };
  const PictureWithDepths now = square_at(0, 0, 0);
  store::use_one_opencv_thread();
  store::OpticalFlowEstimator flow;
  const PictureWithDepths moved = moved_along_flow(now.luma, square_at(3, 1, 0.02F), flow);
  const auto mean_of_square = [&](const PictureWithDepths& then) {
    const TemporalNeighbour other{&then.luma, &then.depths};
    const InverseDepthMap mixed =
        temporal_filter(now.depths, now.luma, std::span(&other, 1), kTolerance);
    double sum = 0;
    int count = 0;
    for (int y = kFirst + 6; y < kLast - 6; ++y) {
      for (int x = kFirst + 6; x < kLast - 6; ++x, ++count) sum += mixed.at(x, y);
    }
    return sum / count;
  };
  // (0.40 + 0.6 x 0.42) / 1.6 where both show the same.
  EXPECT_NEAR(mean_of_square(moved), 0.4075, 0.0015);
  EXPECT_LT(mean_of_square(square_at(3, 1, 0.02F)), 0.402) << "without following it";
  // What the square uncovers, or what leaves the picture, is not mixed with it.
  const PictureWithDepths out = moved_along_flow(
      square_at(0, 0, 0).luma, {Luma(kSide, kSide, 0), InverseDepthMap(kSide, kSide, 0.4F)}, flow);
  const TemporalNeighbour nothing{&out.luma, &out.depths};
  EXPECT_EQ(temporal_filter(now.depths, now.luma, std::span(&nothing, 1), kTolerance).values,
            now.depths.values);
}

}  // namespace
}  // namespace raystage::render::temporal_filter_test
