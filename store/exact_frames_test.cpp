// SPDX-License-Identifier: Apache-2.0
#include "store/exact_frames.h"

#include <gtest/gtest.h>

#include <limits>
#include <vector>

namespace raystage::store {
namespace {

constexpr Nanoseconds kMs = 1'000'000;

/// A rig of three cameras with a line time.
rig::Rig rig_of_three(double line_time_us) {
  schemas::RigDocument document;
  for (const char* id : {"a", "b", "c"}) {
    schemas::CameraGeometry& camera = document.cameras.emplace_back().geometry;
    camera.id = id;
    camera.width = camera.height = 100;
    camera.line_time_us = line_time_us;
  }
  return rig::rig_from_document(document);
}

const rig::Rig kGlobal = rig_of_three(0);

/// Three cameras at 10 fps: at the ticks, 30 ms later, and one that lost the frames of ticks 3 and
/// 4, and that of tick 6.
Timeline timeline_of_three() {
  Timeline timeline;
  timeline.fps = 10;
  timeline.tolerance = 50 * kMs;
  for (std::int32_t i = 0; i < 9; ++i) {
    const bool is_lost = i == 3 || i == 4 || i == 6;
    timeline.ticks.push_back(
        {i * 100 * kMs, {i, i, is_lost ? -1 : i}, {0, 30 * kMs, is_lost ? 0 : -20 * kMs}, {}});
  }
  return timeline;
}

TEST(FramesAtTime, BetweenTheFramesBeforeAndAfter) {
  const FrameSelection found = frames_at_time(timeline_of_three(), kGlobal, 110 * kMs);
  EXPECT_EQ(found.time_ns, 110 * kMs);
  EXPECT_EQ(found.present(), 3);
  ASSERT_TRUE(found.is_interpolated(0));
  EXPECT_EQ(found.frame[0], 1);
  EXPECT_EQ(found.second[0].frame, 2);
  EXPECT_NEAR(found.second[0].part, 0.1, 1e-12);
  ASSERT_TRUE(found.is_interpolated(1));  // at 30 and 130 ms
  EXPECT_EQ(found.frame[1], 0);
  EXPECT_EQ(found.second[1].frame, 1);
  EXPECT_NEAR(found.second[1].part, 0.8, 1e-12);
  ASSERT_TRUE(found.is_interpolated(2));  // at 80 and 180 ms
  EXPECT_EQ(found.frame[2], 1);
  EXPECT_NEAR(found.second[2].part, 0.3, 1e-12);
  EXPECT_EQ(found.spread(), 0);
}

TEST(FramesAtTime, FramesOfThatTimeStayAsTheyAre) {
  const Timeline timeline = timeline_of_three();
  for (const Nanoseconds off : {-kMs / 4, Nanoseconds{0}, kMs / 4}) {
    const FrameSelection found = frames_at_time(timeline, kGlobal, 200 * kMs + off);
    EXPECT_FALSE(found.is_interpolated(0));
    EXPECT_EQ(found.frame[0], 2);
    EXPECT_EQ(found.difference[0], -off);
    EXPECT_TRUE(found.is_interpolated(1));
  }
}

TEST(FramesAtTime, BridgesOneLostFrameAndNotTwo) {
  const Timeline timeline = timeline_of_three();
  const FrameSelection one = frames_at_time(timeline, kGlobal, 600 * kMs);  // at 480 and 680 ms
  ASSERT_TRUE(one.is_interpolated(2));
  EXPECT_EQ(one.frame[2], 5);
  EXPECT_EQ(one.second[2].frame, 7);
  EXPECT_NEAR(one.second[2].part, 0.6, 1e-12);
  const FrameSelection two = frames_at_time(timeline, kGlobal, 350 * kMs);
  EXPECT_EQ(two.frame[2], -1) << "neither tick has a frame of it";
  const FrameSelection before = frames_at_time(timeline, kGlobal, 230 * kMs);
  EXPECT_EQ(before.frame[2], 2) << "that of the nearest tick";
  EXPECT_FALSE(before.is_interpolated(2));
  EXPECT_EQ(before.difference[2], -50 * kMs);
}

TEST(AdjacentTicks, AreThoseBeforeAndAfter) {
  const Timeline timeline = timeline_of_three();
  const auto beside = [&](Nanoseconds time) {
    return adjacent_ticks(timeline.ticks, frames_at_time(timeline, kGlobal, time));
  };
  using Ticks = std::vector<std::size_t>;
  EXPECT_EQ(beside(540 * kMs), (Ticks{5, 6}));
  EXPECT_EQ(beside(560 * kMs), (Ticks{5, 6}));
  EXPECT_EQ(beside(10 * kMs), (Ticks{0, 1}));
  EXPECT_EQ(beside(790 * kMs), (Ticks{7, 8}));
  EXPECT_EQ(adjacent_ticks(timeline.ticks, timeline.ticks[5]), (Ticks{4, 6}));
  EXPECT_EQ(adjacent_ticks(timeline.ticks, timeline.ticks[0]), (Ticks{1}));
  EXPECT_EQ(adjacent_ticks(timeline.ticks, timeline.ticks[8]), (Ticks{7}));
  EXPECT_TRUE(beside(950 * kMs).empty());
}

TEST(FramesAtTime, EndsAsTicksDo) {
  const Timeline timeline = timeline_of_three();
  const FrameSelection end = frames_at_time(timeline, kGlobal, 840 * kMs);
  EXPECT_EQ(end.frame, (std::vector<std::int32_t>{8, 8, 8}));
  EXPECT_TRUE(end.second.empty());
  EXPECT_EQ(end.difference[0], -40 * kMs);
  EXPECT_EQ(frames_at_time(timeline, kGlobal, 900 * kMs).present(), 0);
  EXPECT_EQ(
      frames_at_time(timeline, kGlobal, std::numeric_limits<Nanoseconds>::max() / 2).present(), 0);
  EXPECT_EQ(frames_at_time(timeline, kGlobal, -400 * kMs).present(), 0);
  Timeline still = timeline;
  still.ticks.resize(1);
  still.fps = 0;
  EXPECT_EQ(frames_at_time(still, kGlobal, 900 * kMs).present(), 3);
}

// Line time 100 us: a thousandth of the time between two frames, two or three at lost ones.
TEST(FramesAtTime, OfARollingShutterAreAlwaysCorrected) {
  const rig::Rig rig = rig_of_three(100);
  const Timeline timeline = timeline_of_three();
  using Second = FrameSelection::Second;
  const FrameSelection between = frames_at_time(timeline, rig, 600 * kMs);
  EXPECT_EQ(between.frame, (std::vector<std::int32_t>{6, 5, 5}));
  EXPECT_EQ(between.second, (std::vector<Second>{{7, 0, 1e-3}, {6, 0.7, 1e-3}, {7, 0.6, 5e-4}}));
  EXPECT_EQ(between.spread(), 0);
  // The last frames: as of their own middle rows, by the frame before.
  const FrameSelection end = frames_at_time(timeline, rig, 840 * kMs);
  EXPECT_EQ(end.frame, (std::vector<std::int32_t>{7, 7, 7}));
  EXPECT_EQ(end.second, (std::vector<Second>{{8, 1, 1e-3}, {8, 1, 1e-3}, {8, 1, 1e-3}}));
  EXPECT_EQ(end.difference, (std::vector<Nanoseconds>{-40 * kMs, -10 * kMs, -60 * kMs}));
  // Before a gap of two lost frames, by the frame before; and the first, by the frame after.
  const FrameSelection gap = frames_at_time(timeline, rig, 230 * kMs);
  EXPECT_EQ(gap.frame[2], 1);
  EXPECT_EQ(gap.second[2], (Second{2, 1, 1e-3}));
  EXPECT_EQ(gap.difference[2], -50 * kMs);
  const FrameSelection start = frames_at_time(timeline, rig, -10 * kMs);
  EXPECT_EQ(start.frame[1], 0);
  EXPECT_EQ(start.second[1], (Second{1, 0, 1e-3}));
  EXPECT_EQ(start.difference[1], 40 * kMs);
}

TEST(FramesAtTime, ALoneFrameOfARollingShutterStaysAsItIs) {
  Timeline timeline = timeline_of_three();
  for (FrameSelection& tick : timeline.ticks) {
    if (tick.time_ns != 400 * kMs) tick.frame[0] = -1;
  }
  const FrameSelection found = frames_at_time(timeline, rig_of_three(-100), 410 * kMs);
  EXPECT_EQ(found.frame[0], 4);
  EXPECT_FALSE(found.is_interpolated(0));
  EXPECT_EQ(found.difference[0], -10 * kMs);
  timeline.ticks.resize(1);
  EXPECT_TRUE(frames_at_time(timeline, rig_of_three(-100), 0).second.empty());
}

}  // namespace
}  // namespace raystage::store
