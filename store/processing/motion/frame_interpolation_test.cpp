// SPDX-License-Identifier: Apache-2.0
#include "store/processing/motion/frame_interpolation.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <random>
#include <vector>

#include "base/error.h"
#include "testing/store/test_scene.h"

namespace raystage::store {
namespace {

using testing::MovingBoard;
using testing::psnr;

struct InBetween : ::testing::Test {
  InBetween() { use_one_opencv_thread(); }

  RgbImage moved(const RgbImage& from, const RgbImage& to, double part) {
    const FlowImage a = make_flow_image(from), b = make_flow_image(to);
    return interpolate_frame(a, b, estimator.estimate(a.luma, b.luma),
                             estimator.estimate(b.luma, a.luma), {part, 0});
  }

  MovingBoard board;
  OpticalFlowEstimator estimator;
  const RgbImage before = board.at(0), after = board.at(1);
};

TEST_F(InBetween, MotionIsThatOfTheBoard) {
  const FlowField motion =
      estimator.estimate(make_flow_image(before).luma, make_flow_image(after).luma);
  const auto shift = [&](int x, int y) { return motion.at(x, y); };
  EXPECT_NEAR(shift(62, 58).x, board.speed_x, 0.3);
  EXPECT_NEAR(shift(62, 58).y, board.speed_y, 0.3);
  EXPECT_NEAR(shift(10, 10).x, 0, 0.1);
  EXPECT_NEAR(shift(140, 100).y, 0, 0.1);
}

TEST_F(InBetween, MovesWhatMoves) {
  for (const double part : {0.1, 0.25, 0.5, 0.75, 0.9}) {
    const RgbImage truth = board.at(part);
    const RgbImage& nearer = part <= 0.5 ? before : after;
    const double flow = psnr(moved(before, after, part), truth);
    EXPECT_GT(flow, 31) << part;
    EXPECT_GT(flow, psnr(nearer, truth) + 5) << part;
    EXPECT_GT(flow, psnr(blend(before, after, part), truth) + 5) << part;
  }
}

// Pixels of the wall that the board covers in one picture must come from the other picture.
TEST_F(InBetween, TakesWhatIsHiddenInOneFromTheOther) {
  const double part = 0.5;
  const RgbImage truth = board.at(part), flow = moved(before, after, part);
  const auto hidden_once = [&](int x, int y) {
    // At least two pixels from the board's edge, where samples are mixed.
    for (const int dx : {-2, 0, 2}) {
      for (const int dy : {-2, 0, 2}) {
        if (board.covers(x + dx, y + dy, part)) return false;
      }
    }
    return board.covers(x, y, 0) != board.covers(x, y, 1);
  };
  EXPECT_GT(psnr(flow, truth, hidden_once), 26);
  EXPECT_GT(psnr(flow, truth, hidden_once),
            psnr(blend(before, after, part), truth, hidden_once) + 10);
}

TEST_F(InBetween, MeetsBothEnds) {
  EXPECT_GT(psnr(moved(before, after, 0), before), 40);
  EXPECT_GT(psnr(moved(before, after, 1), after), 40);
}

TEST_F(InBetween, IsTheSameForwardsAndBackwards) {
  EXPECT_GT(psnr(moved(before, after, 0.3), moved(after, before, 0.7)), 45);
}

TEST_F(InBetween, LeavesStillPicturesAsTheyAre) {
  EXPECT_EQ(moved(before, before, 0.4), before);
  EXPECT_EQ(blend(before, before, 0.4), before);
}

TEST_F(InBetween, BlendIsTheMeanWeightedByTime) {
  const RgbImage a{2, 1, {0, 10, 200, 255, 7, 100}}, b{2, 1, {255, 20, 100, 255, 8, 0}};
  EXPECT_EQ(blend(a, b, 0), a);
  EXPECT_EQ(blend(a, b, 1), b);
  EXPECT_EQ(blend(a, b, 0.25).values, (std::vector<std::uint8_t>{64, 13, 175, 255, 7, 75}));
}

TEST_F(InBetween, TinyAndOddSizesWork) {
  for (const auto& [width, height] : {std::pair{1, 1}, {1, 40}, {11, 3}, {12, 12}, {13, 97}}) {
    MovingBoard small;
    small.width = width;
    small.height = height;
    small.left = small.top = 2;
    const RgbImage result = moved(small.at(0), small.at(1), 0.5);
    EXPECT_EQ(result.width, width);
    EXPECT_EQ(result.values.size(), static_cast<std::size_t>(3 * width * height));
  }
}

TEST_F(InBetween, RefusesTwoSizes) {
  MovingBoard other;
  other.width = 150;
  EXPECT_THROW(estimator.estimate(make_flow_image(before).luma, make_flow_image(other.at(0)).luma),
               Error);
}

// With independent noise in both pictures, wrong flow vectors have a small photometric difference
// by chance. They must not speckle the result.
TEST_F(InBetween, DoesNotLetChanceDecide) {
  std::mt19937 random(7);
  const auto noisy = [&](RgbImage image) {
    std::normal_distribution<double> noise(0, 6);
    for (std::uint8_t& code : image.values) {
      code = static_cast<std::uint8_t>(std::clamp(code + noise(random), 0.0, 255.0));
    }
    return image;
  };
  const FlowImage a = make_flow_image(noisy(before)), b = make_flow_image(noisy(after));
  const auto sprinkled = [&](FlowField motion) {
    std::uniform_real_distribution<float> shift(-15, 15);
    for (std::size_t i = 0; i < motion.values.size(); i += 7)
      motion.values[i] = {shift(random), shift(random)};
    return motion;
  };
  const FlowField there = estimator.estimate(a.luma, b.luma),
                  back = estimator.estimate(b.luma, a.luma);
  const RgbImage truth = board.at(0.5);
  EXPECT_GT(psnr(interpolate_frame(a, b, sprinkled(there), sprinkled(back), {0.5, 0}), truth),
            psnr(interpolate_frame(a, b, there, back, {0.5, 0}), truth) - 1);
}

// 16 bits and alpha are interpolated as 8 bits are.
TEST_F(InBetween, LevelsAreThoseOfCodes) {
  const FlowImage a = make_flow_image(before), b = make_flow_image(after);
  const FlowField there = estimator.estimate(a.luma, b.luma),
                  back = estimator.estimate(b.luma, a.luma);
  constexpr std::uint16_t kLevels = 257;  // a code
  const auto levels_of = [](const RgbImage& image) {
    std::vector<std::uint16_t> levels;
    for (std::size_t i = 0; i < image.values.size(); ++i) {
      levels.push_back(static_cast<std::uint16_t>(kLevels * image.values[i]));
      if (i % 3 == 2) levels.push_back(65535);
    }
    return levels;
  };
  const std::vector<std::uint16_t> from = levels_of(before), to = levels_of(after);
  std::vector<std::uint16_t> between(from.size());
  interpolate_levels({a.luma, b.luma, there, back}, {0.3, 0}, from, to, between);
  const RgbImage codes = interpolate_frame(a, b, there, back, {0.3, 0});
  double worst = 0;
  for (std::size_t i = 0; i < between.size(); ++i) {
    if (i % 4 == 3) {
      EXPECT_EQ(between[i], 65535);
      continue;
    }
    worst = std::max(worst, std::abs(between[i] / static_cast<double>(kLevels) -
                                     codes.values[i / 4 * 3 + i % 4]));
  }
  EXPECT_LE(worst, 1.2) << "codes are rounded after sampling and after weighting";
}

struct Rolling : InBetween, ::testing::WithParamInterface<double> {};

// Rows of a rolling shutter are moved to one instant: as good as between pictures with a global
// shutter, at and between the times of the two pictures.
TEST_P(Rolling, RowsAreMovedToOneInstant) {
  const double line = GetParam() / board.height;
  const FlowImage a = make_flow_image(board.rolling_at(0, line)),
                  b = make_flow_image(board.rolling_at(1, line));
  const FlowField there = estimator.estimate(a.luma, b.luma),
                  back = estimator.estimate(b.luma, a.luma);
  for (const double part : {0.0, 0.1, 0.5, 0.8, 1.0}) {
    const RgbImage truth = board.at(part);
    const double corrected = psnr(interpolate_frame(a, b, there, back, {part, line}), truth);
    const double uncorrected = psnr(interpolate_frame(a, b, there, back, {part, 0}), truth);
    EXPECT_GT(corrected, 29) << part;
    EXPECT_GT(corrected, uncorrected + 2) << part;
  }
}

INSTANTIATE_TEST_SUITE_P(TopDownAndBottomUp, Rolling, ::testing::Values(0.8, -0.8));

// The slow way: a whole interpolation for the time of each row.
TEST_F(InBetween, RowsAreThoseOfInterpolationsAtTheirTimes) {
  const double line = 0.8 / board.height;
  const FlowImage a = make_flow_image(board.rolling_at(0, line)),
                  b = make_flow_image(board.rolling_at(1, line));
  const FlowField there = estimator.estimate(a.luma, b.luma),
                  back = estimator.estimate(b.luma, a.luma);
  const InstantBetween instant{0.4, line};
  const RgbImage fast = interpolate_frame(a, b, there, back, instant);
  RgbImage slow = fast;
  for (int y = 0; y < slow.height; ++y) {
    const RgbImage whole =
        interpolate_frame(a, b, there, back, {instant.at(y + 0.5, slow.height), 0});
    const auto bytes = static_cast<std::ptrdiff_t>(slow.width) * 3;
    std::copy_n(whole.values.begin() + y * bytes, bytes, slow.values.begin() + y * bytes);
  }
  EXPECT_GT(psnr(fast, slow), 42);
}

// Line times that no shutter has give a picture, whatever it shows.
TEST_F(InBetween, SurvivesAnyLineTime) {
  const FlowImage a = make_flow_image(before), b = make_flow_image(after);
  const FlowField there = estimator.estimate(a.luma, b.luma),
                  back = estimator.estimate(b.luma, a.luma);
  for (const double line : {1e-9, 0.02, -0.1, 1.0, -1e6, 1e17}) {
    for (const double part : {0.0, 0.5, 1.0}) {
      EXPECT_EQ(interpolate_frame(a, b, there, back, {part, line}).values.size(),
                before.values.size());
    }
  }
}

// Pictures without common content must not cause a crash.
TEST_F(InBetween, SurvivesPicturesWithNothingInCommon) {
  RgbImage black = before;
  for (std::uint8_t& code : black.values) code = 0;
  const RgbImage result = moved(black, after, 0.5);
  EXPECT_EQ(result.values.size(), after.values.size());
}

}  // namespace
}  // namespace raystage::store
