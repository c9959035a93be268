// SPDX-License-Identifier: Apache-2.0
#include "store/processing/retime/retime_plan.h"

#include <gtest/gtest.h>

namespace raystage::store {
namespace {

using Kind = RetimedFrame::Kind;

constexpr Nanoseconds kMs = 1'000'000;

// Ticks every 100 ms from 100 ms on, tolerance 50 ms.
struct RetimePlan : ::testing::Test {
  std::vector<RetimedFrame> plan(const std::vector<Nanoseconds>& times, int ticks) {
    timeline.fps = 10;
    timeline.tolerance = 50 * kMs;
    timeline.ticks =
        assign_ticks({times}, 10, 50 * kMs, {100 * kMs, ticks * 100 * kMs}, "test", Nanoseconds{0})
            .ticks;
    return plan_retiming(timeline, 0, times, options, line_time_us);
  }

  Timeline timeline;
  RetimeOptions options;
  double line_time_us = 0;
};

TEST_F(RetimePlan, FrameBetweenItsNeighbours) {
  const auto frames = plan({80 * kMs, 180 * kMs, 280 * kMs}, 2);
  ASSERT_EQ(frames.size(), 2U);
  EXPECT_EQ(frames[0].kind, Kind::kInterpolated);
  EXPECT_EQ(frames[0].first, 0);
  EXPECT_EQ(frames[0].second, 1);
  EXPECT_DOUBLE_EQ(frames[0].part, 0.2);
  EXPECT_EQ(frames[0].time, 100 * kMs);
  EXPECT_EQ(frames[1].first, 1);
  EXPECT_EQ(frames[1].time, 200 * kMs);
}

TEST_F(RetimePlan, FrameOnItsTickStaysAtItsOwnTime) {
  const Nanoseconds near = 200 * kMs + 400'000;  // 0.4 % of the period
  const auto frames = plan({100 * kMs, near, 301 * kMs, 400 * kMs}, 3);
  EXPECT_EQ(frames[0].kind, Kind::kUnchanged);
  EXPECT_EQ(frames[0].time, 100 * kMs);
  EXPECT_EQ(frames[1].kind, Kind::kUnchanged);
  EXPECT_EQ(frames[1].time, near);
  EXPECT_EQ(frames[2].kind, Kind::kInterpolated);
}

TEST_F(RetimePlan, FirstAndLastFrameHaveNothingBeyondAndStay) {
  const auto frames = plan({120 * kMs, 220 * kMs}, 3);
  EXPECT_EQ(frames[0].kind, Kind::kUnchanged);
  EXPECT_EQ(frames[0].time, 120 * kMs);
  EXPECT_EQ(frames[1].kind, Kind::kInterpolated);
  EXPECT_EQ(frames[2].kind, Kind::kMissing);
}

TEST_F(RetimePlan, OneLostFrameIsBridgedAndTwoAreNot) {
  const auto one = plan({80 * kMs, 280 * kMs}, 2);
  EXPECT_EQ(one[0].kind, Kind::kInterpolated);
  EXPECT_EQ(one[1].kind, Kind::kInterpolated);
  EXPECT_DOUBLE_EQ(one[1].part, 0.6);
  const auto two = plan({80 * kMs, 380 * kMs}, 3);
  EXPECT_EQ(two[0].kind, Kind::kUnchanged);  // 20 ms from its tick
  EXPECT_EQ(two[0].time, 80 * kMs);
  EXPECT_EQ(two[1].kind, Kind::kMissing);
  EXPECT_EQ(two[2].kind, Kind::kMissing);
}

// Line time 100 us: a thousandth of the time between two frames.
TEST_F(RetimePlan, FramesOfARollingShutterNeverStay) {
  line_time_us = 100;
  const auto frames = plan({120 * kMs, 220 * kMs, 300 * kMs, 400 * kMs}, 4);
  for (const RetimedFrame& frame : frames) EXPECT_EQ(frame.kind, Kind::kInterpolated);
  // The first one has none before it: at its own time, by the one after.
  EXPECT_EQ(frames[0].first, 0);
  EXPECT_EQ(frames[0].second, 1);
  EXPECT_EQ(frames[0].part, 0);
  EXPECT_EQ(frames[0].line_part, 1e-3);
  EXPECT_EQ(frames[0].time, 120 * kMs);
  EXPECT_DOUBLE_EQ(frames[1].part, 0.8);
  EXPECT_EQ(frames[2].first, 2);
  EXPECT_EQ(frames[2].part, 0);
  EXPECT_EQ(frames[2].time, 300 * kMs);
  // The last one: by the one before.
  EXPECT_EQ(frames[3].first, 2);
  EXPECT_EQ(frames[3].second, 3);
  EXPECT_EQ(frames[3].part, 1);
  EXPECT_EQ(frames[3].time, 400 * kMs);
  options.method = RetimeMethod::kNearest;
  for (const RetimedFrame& frame : plan({120 * kMs, 220 * kMs}, 2)) {
    EXPECT_EQ(frame.kind, Kind::kUnchanged);
  }
}

TEST_F(RetimePlan, LongestGapIsASetting) {
  options.max_gap = 150 * kMs;
  EXPECT_EQ(plan({80 * kMs, 280 * kMs}, 2)[1].kind, Kind::kMissing);
  options.max_gap = 300 * kMs;
  EXPECT_EQ(plan({80 * kMs, 380 * kMs}, 3)[1].kind, Kind::kInterpolated);
}

TEST_F(RetimePlan, NearestMovesNothing) {
  options.method = RetimeMethod::kNearest;
  const auto frames = plan({80 * kMs, 180 * kMs, 380 * kMs}, 3);
  EXPECT_EQ(frames[0].kind, Kind::kUnchanged);
  EXPECT_EQ(frames[0].time, 80 * kMs);
  EXPECT_EQ(frames[1].first, 1);
  EXPECT_EQ(frames[2].kind, Kind::kMissing);
}

TEST_F(RetimePlan, FramesWithoutATimeAreNotUsed) {
  const auto frames = plan({80 * kMs, kExcludedTime, 180 * kMs}, 1);
  EXPECT_EQ(frames[0].first, 0);
  EXPECT_EQ(frames[0].second, 2);
}

TEST_F(RetimePlan, CameraWithoutFramesIsMissingThroughout) {
  timeline.fps = 10;
  timeline.tolerance = 50 * kMs;
  timeline.ticks = {{100 * kMs, {-1}, {0}}};
  EXPECT_EQ(plan_retiming(timeline, 0, {}, options)[0].kind, Kind::kMissing);
}

// Archives need times that increase.
TEST_F(RetimePlan, TimesIncrease) {
  std::vector<Nanoseconds> times;
  for (int i = 0; i < 300; ++i) {
    if (i % 7 == 3 || i % 31 < 4) continue;  // lost
    times.push_back(i * 99 * kMs + (i * 37 % 41) * kMs);
  }
  Nanoseconds last = -1;
  for (const RetimedFrame& frame : plan(times, 290)) {
    if (frame.kind == Kind::kMissing) continue;
    EXPECT_GT(frame.time, last);
    last = frame.time;
  }
}

}  // namespace
}  // namespace raystage::store
