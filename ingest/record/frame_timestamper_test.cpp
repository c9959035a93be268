// SPDX-License-Identifier: Apache-2.0
// Times and counters of devices: those that are right, that drift, step and lie.
#include "ingest/record/frame_timestamper.h"

#include <gtest/gtest.h>
#include <rapidcheck.h>

#include <limits>
#include <optional>

namespace raystage::ingest {
namespace {

FrameTimestamper::Stamp stamped(FrameTimestamper& clock, Nanoseconds utc,
                                std::optional<Nanoseconds> device = {},
                                std::optional<std::uint64_t> sequence = {}) {
  SourceFrame frame;
  frame.device_time = device;
  frame.sequence = sequence;
  return clock.stamp(frame, utc);
}

SourceDescription camera_of(double fps) {
  SourceDescription description;
  description.fps = fps;
  return description;
}

TEST(FrameTimestamper, TakesTheDevicesClockWithItsFirstOffset) {
  FrameTimestamper clock(1000);
  EXPECT_EQ(stamped(clock, 1500, 77).time_ns, 500);
  const auto second = stamped(clock, 1720, 277);  // arrived 20 late
  EXPECT_EQ(second.time_ns, 700);
  EXPECT_EQ(second.arrival_ns, 720);
  clock.reset_device({});
  EXPECT_EQ(stamped(clock, 2000, 5).time_ns, 1000);
}

constexpr Nanoseconds kSecond = kNanosecondsPerSecond;

TEST(FrameTimestamper, AlignsAClockThatStepsToTheHostsAgain) {
  constexpr Nanoseconds kHugeStep = (Nanoseconds{1} << 31) * kSecond / 90000;  // RTP's half range
  constexpr Nanoseconds kInterval = kSecond / 25;
  FrameTimestamper clock(0);
  for (Nanoseconds i = 0; i < 1000; ++i) {
    const auto stamp = stamped(clock, i * kInterval, i * (kInterval + kHugeStep));
    ASSERT_EQ(stamp.time_ns, i * kInterval);
    ASSERT_EQ(stamp.clock_stepped, i > 0);
    ASSERT_EQ(stamp.corrected, i > 0);
  }
  constexpr Nanoseconds kLeast = std::numeric_limits<Nanoseconds>::min();
  Nanoseconds now = 1000 * kInterval;
  for (const Nanoseconds device : {Nanoseconds{1}, Nanoseconds{1} << 62, kLeast, -(kLeast + 1)}) {
    now += kInterval;
    EXPECT_EQ(stamped(clock, now, device).time_ns, now) << device;
  }
}

TEST(FrameTimestamper, KeepsDriftAndSmallSteps) {
  FrameTimestamper clock(0);
  for (Nanoseconds i = 0; i < 10 * 3600; ++i) {
    const auto stamp = stamped(clock, i * kSecond, i * kSecond * 101 / 100);
    ASSERT_EQ(stamp.time_ns, i * kSecond * 101 / 100);
    ASSERT_FALSE(stamp.corrected);
  }
  clock.reset_device({});
  EXPECT_EQ(stamped(clock, 40000 * kSecond, 0).time_ns, 40000 * kSecond);
  EXPECT_EQ(stamped(clock, 40001 * kSecond, 51 * kSecond).time_ns, 40051 * kSecond);
  // The host's clock is set back by an hour.
  const auto set_back = stamped(clock, 36402 * kSecond, 52 * kSecond);
  EXPECT_EQ(set_back.time_ns, 40051 * kSecond + 1);
  EXPECT_TRUE(set_back.corrected);
  EXPECT_EQ(stamped(clock, 36403 * kSecond, 53 * kSecond).time_ns, 40052 * kSecond + 1);
}

TEST(FrameTimestamper, ManySmallStepsKeepTimesNearTheHosts) {
  FrameTimestamper clock(0);
  FrameTimestamper::Stamp last;
  for (Nanoseconds i = 0; i < 100'000; ++i) {  // ahead by 59 s, and back, with every other frame
    last = stamped(clock, i * kSecond / 25, i % 2 * 59 * kSecond - i / 2 * 200 * kSecond);
  }
  EXPECT_LT(last.time_ns, last.arrival_ns + 25 * 3600 * kSecond);
}

TEST(FrameTimestamper, TimesAlwaysIncreaseAndGapsHaveRoom) {
  EXPECT_TRUE(rc::check([] {
    FrameTimestamper clock(0);
    Nanoseconds last = -1;
    const auto frames = *rc::gen::inRange(1, 50);
    for (int i = 0; i < frames; ++i) {
      const auto stamp = stamped(clock, *rc::gen::inRange<Nanoseconds>(-1000, 100000),
                                 *rc::gen::inRange<Nanoseconds>(-1000, 100000),
                                 static_cast<std::uint64_t>(*rc::gen::inRange(0, 30)));
      RC_ASSERT(stamp.time_ns > last);
      Nanoseconds before = last;
      for (std::uint64_t k = 0; k < stamp.skipped; ++k) {
        const Nanoseconds missing =
            FrameTimestamper::interpolate_time(last, stamp.time_ns, k, stamp.skipped);
        RC_ASSERT(missing > before);
        RC_ASSERT(missing < stamp.time_ns);
        before = missing;
      }
      last = stamp.time_ns;
    }
  }));
}

TEST(FrameTimestamper, CountsWhatTheSourceSkipped) {
  FrameTimestamper clock(0);
  EXPECT_EQ(stamped(clock, 100, {}, 7).skipped, 0U);  // the first value is arbitrary
  EXPECT_EQ(stamped(clock, 200, {}, 8).skipped, 0U);
  const auto gap = stamped(clock, 300, {}, 12);
  EXPECT_EQ(gap.skipped, 3U);
  EXPECT_EQ(gap.sequence, 12U);
  EXPECT_EQ(stamped(clock, 400, {}, 3).skipped, 0U);  // the counter was reset
  EXPECT_EQ(stamped(clock, 500, {}, std::uint64_t{1} << 60).skipped, 0U);
}

TEST(FrameTimestamper, BelievesOfTheCounterWhatTheTimeAllows) {
  FrameTimestamper clock(0);
  clock.reset_device(camera_of(50));
  stamped(clock, 0, {}, 1);
  EXPECT_EQ(stamped(clock, 3600 * kSecond, {}, 1 + 3600 * 50).skipped, 3600 * 50 - 1U);
  // The host stalled: the frames after it arrive together.
  EXPECT_EQ(stamped(clock, 3600 * kSecond + 1000, {}, 1 + 3601 * 50).skipped, 49U);
  std::uint64_t sequence = 200'000, skipped = 0;
  constexpr Nanoseconds kFrames = 1000;
  for (Nanoseconds i = 1; i <= kFrames; ++i) {
    const auto stamp = stamped(clock, 3601 * kSecond + i * kSecond / 50, {}, sequence);
    EXPECT_TRUE(stamp.counter_jumped) << i;
    skipped += stamp.skipped;
    sequence += 999'999;
  }
  EXPECT_EQ(skipped, 0U);
  // As many as can be without a jump: no more than twice the frames of this time.
  for (Nanoseconds i = 1; i <= kFrames; ++i) {
    const std::uint64_t next = sequence + 100;
    const auto stamp = stamped(clock, 3700 * kSecond + i * kSecond / 50, {}, next);
    skipped += stamp.skipped;
    sequence = next;
  }
  EXPECT_LT(skipped, 2 * kFrames + 300);
}

TEST(FrameTimestamper, CountsLossesAtTheRateAtWhichFramesArrive) {
  FrameTimestamper clock(0);
  clock.reset_device(camera_of(10));  // as its node says; the trigger runs at 100 Hz
  std::uint64_t sequence = 0;
  Nanoseconds now = 0;
  const auto next = [&](std::uint64_t lost) {
    sequence += lost + 1;
    now += static_cast<Nanoseconds>(lost + 1) * kSecond / 100;
    return stamped(clock, now, {}, sequence);
  };
  for (int i = 0; i < 150; ++i) EXPECT_EQ(next(0).skipped, 0U);
  for (int i = 0; i < 20; ++i) {
    const auto stamp = next(75);
    EXPECT_EQ(stamp.skipped, 75U);
    EXPECT_FALSE(stamp.counter_jumped);
    for (int k = 0; k < 20; ++k) EXPECT_EQ(next(0).skipped, 0U);
  }
}

TEST(FrameTimestamper, TimesOfAFilePassAsFastAsItIsRead) {
  SourceDescription file = camera_of(25);
  file.live = false;
  for (const Nanoseconds speed : {Nanoseconds{1}, Nanoseconds{1000}}) {  // of the recording
    FrameTimestamper clock(0);
    clock.reset_device(file);
    for (Nanoseconds i = 0; i < 20'000; ++i) {
      const auto stamp = stamped(clock, i * speed * kSecond / 250, i * kSecond / 25);
      ASSERT_EQ(stamp.time_ns, i * kSecond / 25);
      ASSERT_FALSE(stamp.corrected);
    }
  }
  FrameTimestamper clock(0);
  clock.reset_device(file);
  stamped(clock, 0, 0);
  EXPECT_EQ(stamped(clock, kSecond, Nanoseconds{1} << 60).time_ns, kSecond)
      << "a time that no archive holds is none";
}

}  // namespace
}  // namespace raystage::ingest
