// SPDX-License-Identifier: Apache-2.0
#include "store/timeline.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rapidcheck.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <random>
#include <set>

#include "base/error.h"
#include "base/little_endian.h"
#include "base/resources.h"
#include "store/timeline_file.h"
#include "testing/store/take_test_data.h"
#include "testing/test_folder.h"
#include "testing/test_paths.h"

namespace raystage::store::timeline_test {
namespace {

using ::testing::HasSubstr;
using Times = std::vector<std::vector<Nanoseconds>>;

constexpr Nanoseconds kMs = 1'000'000;

Timeline timeline_of(const Times& times, double fps = 0, Nanoseconds tolerance = 0,
                     double nominal_fps = 15) {
  return build_timeline(times, nominal_fps, fps, tolerance, "test");
}

std::vector<Nanoseconds> frames(double fps, Nanoseconds start, int count) {
  std::vector<Nanoseconds> times;
  for (int i = 0; i < count; ++i) times.push_back(start + std::llround(i * 1e9 / fps));
  return times;
}

// Checks the properties of every timeline, for any frame times.
void expect_sound(const Timeline& timeline, const Times& times) {
  std::vector<std::set<std::int32_t>> used(times.size());
  for (std::size_t k = 0; k < timeline.ticks.size(); ++k) {
    const FrameSelection& tick = timeline.ticks[k];
    ASSERT_EQ(tick.frame.size(), times.size());
    const Nanoseconds ideal =
        timeline.ticks[0].time_ns + std::llround(static_cast<double>(k) * 1e9 / timeline.fps);
    ASSERT_LE(std::abs(tick.time_ns - ideal), 1);
    for (std::size_t camera = 0; camera < times.size(); ++camera) {
      const std::int32_t frame = tick.frame[camera];
      if (frame < 0) {
        ASSERT_EQ(tick.difference[camera], 0);
        continue;
      }
      ASSERT_LT(static_cast<std::size_t>(frame), times[camera].size());
      const Nanoseconds time = times[camera][frame];
      ASSERT_EQ(tick.difference[camera], time - tick.time_ns);
      ASSERT_LE(std::abs(tick.difference[camera]), timeline.tolerance);
      ASSERT_TRUE(used[camera].insert(frame).second) << "a frame stands in two ticks";
      // The frame is the nearest to the tick, and the tick the nearest to the frame.
      for (const Nanoseconds other : times[camera]) {
        ASSERT_LE(std::abs(time - tick.time_ns), std::abs(other - tick.time_ns));
      }
      ASSERT_LE(static_cast<double>(std::abs(tick.difference[camera])), 0.5e9 / timeline.fps + 1);
    }
  }
}

TEST(Timeline, SynchronousCameras) {
  const Times times(4, frames(15, 0, 10));
  const Timeline timeline = timeline_of(times);
  expect_sound(timeline, times);
  ASSERT_EQ(timeline.ticks.size(), 10u);
  EXPECT_NEAR(timeline.fps, 15, 1e-6);
  EXPECT_EQ(timeline.tolerance, 33'333'333);
  EXPECT_EQ(timeline.ticks[0].time_ns, 0);
  for (const auto& tick : timeline.ticks) {
    EXPECT_EQ(tick.present(), 4);
    EXPECT_EQ(tick.spread(), 0);
  }
}

TEST(Timeline, OneDropMovesNothingElse) {
  Times times;
  std::mt19937 random(11);
  for (int camera = 0; camera < 8; ++camera) {
    times.push_back(frames(15, static_cast<Nanoseconds>(random() % 60'000'000), 30));
  }
  const Timeline before = timeline_of(times);
  expect_sound(before, times);
  // Removes the frame of camera 3 in the middle of the take.
  std::size_t tick = before.ticks.size() / 2;
  const std::int32_t dropped = before.ticks[tick].frame[3];
  ASSERT_GE(dropped, 0);
  times[3].erase(times[3].begin() + dropped);
  const Timeline after = timeline_of(times, before.fps);
  expect_sound(after, times);
  ASSERT_EQ(after.ticks.size(), before.ticks.size());
  for (std::size_t k = 0; k < before.ticks.size(); ++k) {
    for (std::size_t camera = 0; camera < times.size(); ++camera) {
      std::int32_t expected = before.ticks[k].frame[camera];
      if (camera == 3 && k == tick) expected = -1;
      if (camera == 3 && expected > dropped) --expected;
      ASSERT_EQ(after.ticks[k].frame[camera], expected) << k << " " << camera;
    }
  }
}

TEST(Timeline, StartUpLossAndEarlyEnd) {
  // Most cameras run from 1 s to 4 s; one starts late, one ends early.
  Times times(4, frames(10, 1000 * kMs, 31));
  times[0] = frames(10, 0, 51);
  times[2] = frames(10, 2000 * kMs, 21);
  times[3] = frames(10, 1000 * kMs, 11);
  const Timeline timeline = timeline_of(times);
  expect_sound(timeline, times);
  ASSERT_EQ(timeline.ticks.size(), 31u);
  EXPECT_EQ(timeline.ticks.front().time_ns, 1000 * kMs);
  EXPECT_EQ(timeline.ticks.back().time_ns, 4000 * kMs);
  EXPECT_EQ(timeline.ticks.front().frame, (std::vector<std::int32_t>{10, 0, -1, 0}));
  EXPECT_EQ(timeline.ticks.back().frame, (std::vector<std::int32_t>{40, 30, 20, -1}));
}

TEST(Timeline, StillLightField) {
  const Timeline still = timeline_of({{0}, {0}, {}, {0}}, 0, 0, 0);
  ASSERT_EQ(still.ticks.size(), 1u);
  EXPECT_EQ(still.ticks[0].time_ns, 0);
  EXPECT_EQ(still.ticks[0].frame, (std::vector<std::int32_t>{0, 0, -1, 0}));
  // Free-running cameras: all frames are within half a period of one tick.
  const Timeline loose = timeline_of({{0}, {30 * kMs}, {60 * kMs}});
  ASSERT_EQ(loose.ticks.size(), 1u);
  EXPECT_EQ(loose.ticks[0].time_ns, 30 * kMs);
  EXPECT_EQ(loose.ticks[0].present(), 3);
  EXPECT_EQ(loose.ticks[0].spread(), 60 * kMs);
  // If frames are too far apart, only the middle one is used.
  const Timeline far = timeline_of({{0}, {500 * kMs}, {9000 * kMs}});
  ASSERT_EQ(far.ticks.size(), 1u);
  EXPECT_EQ(far.ticks[0].frame, (std::vector<std::int32_t>{-1, 0, -1}));
}

TEST(Timeline, GivenRateAndTolerance) {
  const Times times{frames(15, 0, 16), frames(15, 20 * kMs, 16)};
  const Timeline twice = timeline_of(times, 30);
  expect_sound(twice, times);
  EXPECT_EQ(twice.fps, 30);
  EXPECT_EQ(std::ranges::count_if(twice.ticks, [](const auto& t) { return t.frame[0] >= 0; }), 16);
  const Timeline strict = timeline_of(times, 15, 5 * kMs);
  expect_sound(strict, times);
  EXPECT_EQ(strict.tolerance, 5 * kMs);
  for (const auto& tick : strict.ticks) EXPECT_EQ(tick.present(), 0);
  const Timeline wide = timeline_of(times, 15, 200 * kMs);  // wider than a frame time
  expect_sound(wide, times);
}

TEST(Timeline, RefusesNonsense) {
  const Times times{frames(15, 0, 4)};
  EXPECT_THROW(timeline_of(times, -1), Error);
  EXPECT_THROW(timeline_of(times, std::nan("")), Error);
  EXPECT_THROW(timeline_of(times, std::numeric_limits<double>::infinity()), Error);
  EXPECT_THROW(timeline_of(times, 15, -1), Error);
  EXPECT_THROW(timeline_of({{}, {}}), Error);
  const Times long_gap{{0, 9'000'000 * kNanosecondsPerSecond}};
  EXPECT_THROW(timeline_of(long_gap, 1000), Error);
  // The number of ticks is beyond int64.
  constexpr Nanoseconds kFar = 6'900'000'000 * kNanosecondsPerSecond;
  EXPECT_THROW(assign_ticks({{}}, 1e9, 1, {-kFar, kFar}, "test"), Error);
}

TEST(Timeline, HasNoMoreTicksThanFitInHalfOfTheMemory) {
  EXPECT_LE(most_ticks(1), 10'000'000u);
  for (const std::size_t cameras : {64u, 1000u, 10'000u}) {
    const std::size_t bytes = cameras * 3 * (sizeof(std::int32_t) + sizeof(Nanoseconds));
    EXPECT_LE(most_ticks(cameras), available_memory() / 2 / bytes) << cameras;
  }
  const Times minutes(10'000, {0, 1'000'000 * kNanosecondsPerSecond});
  EXPECT_THROW(timeline_of(minutes, 5), Error);  // 5 million ticks of 10,000 cameras
}

TEST(CameraClock, CorrectsAsAWalkOverItsStepsDoes) {
  std::mt19937 random(4);
  for (const int count : {0, 1, 2, 9}) {
    std::vector<ClockStep> steps;
    CameraClock clock;
    clock.offset_ns = 13;
    for (int i = 0; i < count; ++i) {  // in any order, and two at one time
      steps.push_back(
          {static_cast<Nanoseconds>(random() % 20), static_cast<int>(random() % 9) - 4});
      clock.steps.add(steps.back());
    }
    for (Nanoseconds stamp = -1; stamp <= 20; ++stamp) {
      Nanoseconds expected = stamp - 13;
      for (const ClockStep& step : steps) expected -= stamp >= step.time_ns ? step.step_ns : 0;
      ASSERT_EQ(clock.corrected(stamp), expected) << count << " " << stamp;
    }
  }
}

// A walk over the steps would take hours.
TEST(CameraClock, AMillionStepsCorrectMillionsOfStamps) {
  CameraClock clock;
  for (int i = 0; i < 1'000'000; ++i) clock.steps.add({i, 1});
  Nanoseconds sum = 0;
  for (Nanoseconds stamp = 0; stamp < 5'000'000; ++stamp) sum += clock.corrected(stamp);
  EXPECT_EQ(sum, 7'999'997'000'000) << "a million times -1, then 0, 1, 2 ...";
}

TEST(Timeline, FreeRunningCamerasProperty) {
  rc::check([] {
    const auto seed = *rc::gen::arbitrary<unsigned>();
    const auto cameras = *rc::gen::inRange(1, 9);
    const auto jitter_us = *rc::gen::inRange(0, 3000);
    const auto drop_percent = *rc::gen::inRange(0, 40);
    std::mt19937 random(seed);
    Times times;
    for (int camera = 0; camera < cameras; ++camera) {
      auto column = frames(15, 10 * kMs + static_cast<Nanoseconds>(random() % 400'000'000), 20);
      for (Nanoseconds& time : column) {
        time += static_cast<Nanoseconds>(random() % static_cast<unsigned>(jitter_us + 1)) * 1000;
      }
      std::erase_if(column,
                    [&](Nanoseconds) { return static_cast<int>(random() % 100) < drop_percent; });
      times.push_back(std::move(column));
    }
    times[0].push_back(3'000'000'000);
    const Timeline timeline = timeline_of(times);
    expect_sound(timeline, times);
    RC_ASSERT(!::testing::Test::HasFailure());
    // A camera is absent at a tick only if it has no frame within the tolerance.
    for (const FrameSelection& tick : timeline.ticks) {
      for (std::size_t camera = 0; camera < times.size(); ++camera) {
        if (tick.frame[camera] >= 0) continue;
        for (const Nanoseconds time : times[camera]) {
          RC_ASSERT(std::abs(time - tick.time_ns) >= timeline.tolerance);
        }
      }
    }
  });
}

TEST(Timeline, SixtyFourFreeRunningCamerasLoseNothing) {
  std::mt19937 random(2);
  Times times;
  for (int camera = 0; camera < 64; ++camera) {
    times.push_back(frames(15, static_cast<Nanoseconds>(random() % 66'666'667), 48));
    for (Nanoseconds& time : times.back()) time += static_cast<Nanoseconds>(random() % 500'000);
  }
  const Timeline timeline = timeline_of(times);
  expect_sound(timeline, times);
  for (std::size_t k = 1; k + 1 < timeline.ticks.size(); ++k) {
    EXPECT_EQ(timeline.ticks[k].present(), 64) << k;
  }
}

TEST(SelectFrames, WithinTolerance) {
  const testing::TestFolder folder;
  testing::write_take(folder.path() / "take", {{100, 200}, {}, {150}});
  const Take take(folder.path() / "take");
  const auto near = select_frames(take, 160, 40);
  EXPECT_EQ(near.frame, (std::vector<std::int32_t>{1, -1, 0}));
  EXPECT_EQ(near.difference, (std::vector<Nanoseconds>{40, 0, -10}));
  EXPECT_EQ(near.spread(), 50);
  EXPECT_EQ(near.present(), 2);
  EXPECT_EQ(select_frames(take, 160, 39).frame, (std::vector<std::int32_t>{-1, -1, 0}));
  EXPECT_EQ(select_frames(take, std::numeric_limits<Nanoseconds>::min(), 1000).present(), 0);
  EXPECT_EQ(select_frames(take, 160, -1).present(), 0);
}

TEST(SelectFrames, WithinHalfAPeriodOrHoweverFarWhereTheRateIsUnknown) {
  EXPECT_EQ(default_frame_tolerance(10), 50 * kMs);
  constexpr Nanoseconds kFarthest = std::numeric_limits<Nanoseconds>::max();
  for (const double fps : {0.0, 1e-11, 1e-300}) EXPECT_EQ(default_frame_tolerance(fps), kFarthest);
  EXPECT_EQ(default_frame_tolerance(1), kNanosecondsPerSecond / 2);
}

TEST(NearestTick, WithinHalfATickTheEarlierAtATie) {
  std::vector<FrameSelection> ticks(3);
  for (std::size_t i = 0; i < ticks.size(); ++i) ticks[i].time_ns = 100 + 10 * static_cast<int>(i);
  const auto at = [&](Nanoseconds time) {
    const auto tick = nearest_tick(ticks, time);
    return tick ? static_cast<int>(*tick) : -1;
  };
  EXPECT_EQ(at(94), -1);
  EXPECT_EQ(at(95), 0);
  EXPECT_EQ(at(105), 0);
  EXPECT_EQ(at(106), 1);
  EXPECT_EQ(at(120), 2);
  EXPECT_EQ(at(125), 2);
  EXPECT_EQ(at(126), -1);
  EXPECT_EQ(at(std::numeric_limits<Nanoseconds>::min()), -1);
  EXPECT_EQ(at(std::numeric_limits<Nanoseconds>::max()), -1);
  ticks.resize(1);
  EXPECT_EQ(at(std::numeric_limits<Nanoseconds>::max()), 0) << "a still";
  ticks.clear();
  EXPECT_EQ(at(0), -1);
}

TEST(TimelineStatistics, CountsSpreadAndAbsence) {
  Timeline timeline;
  timeline.fps = 10;
  timeline.ticks.resize(3);
  timeline.ticks[0] = {0, {0, 0}, {-2, 4}};
  timeline.ticks[1] = {100, {1, -1}, {1, 0}};
  timeline.ticks[2] = {200, {2, 1}, {0, 3}};
  const auto statistics = timeline_statistics(timeline);
  EXPECT_EQ(statistics.absent, (std::vector<int>{0, 1}));
  EXPECT_EQ(statistics.max_spread, 6);
  EXPECT_EQ(statistics.median_spread, 3);
  EXPECT_DOUBLE_EQ(statistics.mean_spread_ns, 3);
}

struct TimelineFile : ::testing::Test {
  TimelineFile() { testing::write_take(path, {frames(15, 0, 30), frames(15, 9 * kMs, 25)}); }
  static void expect_same(const Timeline& a, const Timeline& b) {
    EXPECT_EQ(a.fps, b.fps);
    EXPECT_EQ(a.tolerance, b.tolerance);
    EXPECT_EQ(a.clocks, b.clocks);
    ASSERT_EQ(a.ticks.size(), b.ticks.size());
    for (std::size_t k = 0; k < a.ticks.size(); ++k) {
      EXPECT_EQ(a.ticks[k].time_ns, b.ticks[k].time_ns);
      EXPECT_EQ(a.ticks[k].frame, b.ticks[k].frame);
      EXPECT_EQ(a.ticks[k].difference, b.ticks[k].difference);
    }
  }
  std::string refusal() const {
    try {
      read_timeline(Take(path));
    } catch (const Error& error) {
      EXPECT_EQ(error.exit_code(), ExitCode::kBadInput);
      EXPECT_THAT(error.what_to_do(), HasSubstr("raystage sync"));
      return error.what_happened();
    }
    return "";
  }

  testing::TestFolder folder;
  std::filesystem::path path = folder.path() / "take";
  std::filesystem::path file = path / kTimelineFile;
};

TEST_F(TimelineFile, GivesBackWhatWentInReproducibly) {
  EXPECT_THAT(refusal(), HasSubstr("no timeline"));
  const Take take(path);
  Timeline timeline = build_timeline(take, 0, 0);
  timeline.clocks = {CameraClock{}, CameraClock{}};
  write_timeline(timeline, path);
  const auto bytes = testing::bytes_of(file);
  expect_same(read_timeline(take), timeline);
  write_timeline(build_timeline(Take(path), 0, 0), path);
  EXPECT_EQ(testing::bytes_of(file), bytes);
}

TEST_F(TimelineFile, KeepsEveryCamerasClock) {
  const Take take(path);
  Timeline timeline = build_timeline(take, 0, 0);
  CameraClock ahead;  // by 7 ms, from the sixth frame on by 47 ms
  ahead.offset_ns = 7 * kMs;
  ahead.steps = {{take.archive(1).frames()[5].time_ns, 40 * kMs}};
  CameraClock fitted{0, {}, 66'666'670.25, 1e9, 0.055, 4'900'000.5, true};
  timeline.clocks = {fitted, ahead};
  for (FrameSelection& tick : timeline.ticks) {
    if (tick.frame[0] >= 0) tick.difference[0] += 3 * kMs;
    if (tick.frame[1] >= 0) tick.difference[1] -= (tick.frame[1] >= 5 ? 47 : 7) * kMs;
  }
  write_timeline(timeline, path);
  expect_same(read_timeline(take), timeline);
  timeline.ticks[10].difference[1] += 1;
  write_timeline(timeline, path);
  EXPECT_THAT(refusal(), HasSubstr("refers to a frame"));
  timeline.ticks[10].difference[1] -= 1;
  timeline.ticks[10].difference[0] += 70 * kMs;  // more than a period
  write_timeline(timeline, path);
  EXPECT_THAT(refusal(), HasSubstr("refers to a frame"));
}

TEST_F(TimelineFile, ReadsVersionOne) {
  // A file of the first release: two cameras, no clocks.
  const auto bytes =
      testing::bytes_of(testing::source_folder() / "tests/fuzz/corpus/timeline/file");
  const Timeline timeline = decode_timeline(std::span(bytes).subspan(1), 1, 2, "");
  EXPECT_TRUE(timeline.clocks.empty());
  ASSERT_FALSE(timeline.ticks.empty());
  const Timeline again = decode_timeline(encode_timeline(timeline, 1), 1, 2, "");
  EXPECT_EQ(again.clocks, std::vector<CameraClock>(2));
  EXPECT_EQ(again.ticks[0].frame, timeline.ticks[0].frame);
}

TEST_F(TimelineFile, OfAnotherTakeIsRefused) {
  write_timeline(build_timeline(Take(path), 0, 0), path);
  testing::write_take(folder.path() / "other", {frames(15, 0, 30), frames(15, 9 * kMs + 1, 25)});
  std::filesystem::rename(file, folder.path() / "other" / kTimelineFile);
  path = folder.path() / "other";
  EXPECT_THAT(refusal(), HasSubstr("is of another take"));
}

TEST_F(TimelineFile, StaysValidWhenTheTakeIsRenamed) {
  write_timeline(build_timeline(Take(path), 0, 0), path);
  schemas::TakeDocument document = schemas::read_take(path / "take.json");
  document.name = "a better name";
  schemas::write_take(document, path / "take.json");
  EXPECT_EQ(refusal(), "");
}

TEST_F(TimelineFile, MoreTicksThanCanBeComputedAreRefusedUnread) {
  // A zstd frame with one block that is not compressed: the header alone.
  std::vector<std::byte> bytes(9 + 48);
  store_little_endian(bytes, 0, std::uint32_t{0xFD2FB528});
  store_little_endian(bytes, 4, std::uint16_t{0x3020});  // one segment of 48 bytes
  store_little_endian(bytes, 6, std::uint16_t{48 << 3 | 1});
  std::ranges::copy(std::as_bytes(std::span("RAYSTIME", 8)), bytes.begin() + 9);
  store_little_endian(bytes, 9 + 8, std::uint32_t{2});
  store_little_endian(bytes, 9 + 12, std::uint32_t{2});
  store_little_endian(bytes, 9 + 24, std::bit_cast<std::uint64_t>(15.0));
  const auto refusal_of = [&](std::uint64_t ticks) -> std::string {
    store_little_endian(bytes, 9 + 40, ticks);
    try {
      decode_timeline(bytes, std::nullopt, 2, "");
    } catch (const Error& error) {
      return error.what_happened();
    }
    return "";
  };
  const std::size_t most = 4 * bytes.size();
  EXPECT_THAT(refusal_of(most), HasSubstr("damaged")) << "its ticks are not there";
  EXPECT_THAT(refusal_of(most + 1), HasSubstr("allowed: 228"));
  EXPECT_THAT(refusal_of(100'000'000), HasSubstr("100000000 ticks of 2 cameras, allowed: 228"));
  bytes.resize(100'000'000);  // what follows the header is not read either
  EXPECT_THAT(refusal_of(most_ticks(2)), HasSubstr("damaged"));
  EXPECT_THAT(refusal_of(most_ticks(2) + 1), HasSubstr("allowed: "));
}

TEST_F(TimelineFile, SmallFilesHaveFewTicks) {
  Timeline timeline;
  timeline.fps = 15;
  timeline.ticks.assign(100'000, {0, {-1, -1}, {0, 0}});
  const std::vector<std::byte> bomb = encode_timeline(timeline, 1);
  EXPECT_LT(bomb.size(), 2000U);
  try {
    decode_timeline(bomb, 1, 2, "");
    ADD_FAILURE() << "a small file made much work";
  } catch (const Error& error) {
    EXPECT_THAT(error.what_happened(), HasSubstr("100000 ticks of 2 cameras, allowed: "));
  }
  // Times that compress as well as times can.
  constexpr std::int64_t kPeriod = std::int64_t{1} << 32;
  timeline.fps = 1e9 / static_cast<double>(kPeriod);
  for (std::size_t i = 0; i < timeline.ticks.size(); ++i) {
    timeline.ticks[i].time_ns = static_cast<std::int64_t>(i) * kPeriod;
  }
  EXPECT_EQ(decode_timeline(encode_timeline(timeline, 1), 1, 2, "").ticks.size(), 100'000U);
}

TEST_F(TimelineFile, TheLongestTakeCanBeRead) {
  std::filesystem::remove_all(path);
  testing::write_take(path, {{0, kMaxArchiveTime}, {0, kMaxArchiveTime - kMs}});
  const Timeline timeline = build_timeline(Take(path), 0, 0);
  EXPECT_EQ(timeline.ticks.size(), 2u);
  write_timeline(timeline, path);
  EXPECT_EQ(refusal(), "");
}

TEST_F(TimelineFile, TimesThatCouldOverflowAreRefused) {
  Timeline timeline = build_timeline(Take(path), 0, 0);
  timeline.clocks.resize(2);
  constexpr Nanoseconds kFar = Nanoseconds{1} << 60;
  const auto is_read = [&](const auto& change) {
    Timeline changed = timeline;
    change(changed);
    try {
      decode_timeline(encode_timeline(changed, 1), 1, 2, "");
    } catch (const Error& error) {
      EXPECT_THAT(error.what_happened(), HasSubstr("damaged"));
      return false;
    }
    return true;
  };
  for (const Nanoseconds sign : {-1, 1}) {
    for (const Nanoseconds beyond : {0, 1}) {
      const Nanoseconds time = sign * (kFar + beyond);
      const bool is_near = beyond == 0;
      EXPECT_EQ(is_read([&](Timeline& t) { t.ticks[3].time_ns = time; }), is_near);
      EXPECT_EQ(is_read([&](Timeline& t) { t.ticks[3].difference[1] = time; }), is_near);
      EXPECT_EQ(is_read([&](Timeline& t) { t.clocks[1].offset_ns = time; }), is_near);
      EXPECT_EQ(is_read([&](Timeline& t) { t.clocks[1].steps = {{5, time}}; }), is_near);
      EXPECT_EQ(is_read([&](Timeline& t) {
                  t.clocks[1].steps = {{5, time - sign}, {6, sign}, {7, -time}};
                }),
                is_near);
    }
  }
  EXPECT_TRUE(is_read([&](Timeline& t) { t.tolerance = kFar; }));
  EXPECT_FALSE(is_read([&](Timeline& t) { t.tolerance = kFar + 1; }));
  const auto is_rate = [&](double fps) { return is_read([&](Timeline& t) { t.fps = fps; }); };
  EXPECT_TRUE(is_rate(1e9));
  for (const double fps : {1e-300, 0.9e-9, 1.1e9, std::nan("")}) EXPECT_FALSE(is_rate(fps)) << fps;
  timeline.ticks.resize(3);
  EXPECT_TRUE(is_rate(1e-9));
  timeline.ticks.resize(4, timeline.ticks[0]);
  EXPECT_FALSE(is_rate(1e-9)) << "127 years";
  const auto is_period = [&](double period) {
    return is_read([&](Timeline& t) { t.clocks[1].period_ns = period; });
  };
  for (const double period : {0.0, 1.0, 1e18}) EXPECT_TRUE(is_period(period)) << period;
  for (const double period : {1e-300, 0.9, 1.1e18}) EXPECT_FALSE(is_period(period)) << period;
}

TEST_F(TimelineFile, DamageIsRefused) {
  write_timeline(build_timeline(Take(path), 0, 0), path);
  const auto bytes = testing::bytes_of(file);
  const std::uint64_t fingerprint = take_fingerprint(Take(path));
  for (std::size_t size = 0; size < bytes.size(); ++size) {
    ASSERT_THROW(decode_timeline(std::span(bytes).first(size), fingerprint, 2, ""), Error) << size;
  }
  auto longer = bytes;
  longer.push_back(std::byte{0});
  EXPECT_THROW(decode_timeline(longer, fingerprint, 2, ""), Error);
  testing::overwrite(file, std::span(bytes).first(bytes.size() - 1));
  EXPECT_THAT(refusal(), HasSubstr("damaged"));
  for (std::size_t bit = 0; bit < 8 * bytes.size(); ++bit) {
    auto rotten = bytes;
    rotten[bit / 8] ^= static_cast<std::byte>(1u << (bit % 8));
    try {
      // Some bits of zstd's frame header have no effect; then the timeline is unchanged.
      expect_same(decode_timeline(rotten, fingerprint, 2, ""),
                  decode_timeline(bytes, fingerprint, 2, ""));
    } catch (const Error&) {
    }
  }
}

}  // namespace
}  // namespace raystage::store::timeline_test
