// SPDX-License-Identifier: Apache-2.0
#include "store/processing/sync/resync.h"

#include <gtest/gtest.h>
#include <rapidcheck.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "base/error.h"
#include "store/processing/sync/losses.h"
#include "testing/store/simulated_stamps.h"

namespace raystage::store::resync_test {
namespace {

using testing::cameras_of;
using testing::SimulatedStamps;
using Jitter = SimulatedStamps::Jitter;
using Options = SimulatedStamps::Options;

constexpr Nanoseconds kMs = 1'000'000;

std::vector<CameraTimestamps> cameras_at(std::vector<std::vector<Nanoseconds>> stamps) {
  std::vector<CameraTimestamps> cameras;
  for (auto& column : stamps) {
    cameras.push_back({"c" + std::to_string(cameras.size()), "", std::move(column), {}});
  }
  return cameras;
}

std::vector<Nanoseconds> frames(double fps, Nanoseconds start, int count) {
  std::vector<Nanoseconds> times;
  for (int i = 0; i < count; ++i) times.push_back(start + std::llround(i * 1e9 / fps));
  return times;
}

// Checks each tick and camera by an exhaustive search over all frames and ticks.
void expect_as_reference(const Timeline& timeline,
                         const std::vector<std::vector<Nanoseconds>>& times) {
  const double period = 1e9 / timeline.fps;
  const auto nearest_tick = [&](Nanoseconds time) {
    std::size_t nearest = 0;
    for (std::size_t k = 0; k < timeline.ticks.size(); ++k) {
      if (std::abs(time - timeline.ticks[k].time_ns) <
          std::abs(time - timeline.ticks[nearest].time_ns)) {
        nearest = k;
      }
    }
    return nearest;
  };
  for (std::size_t c = 0; c < times.size(); ++c) {
    std::vector<std::int32_t> expected(timeline.ticks.size(), -1);
    for (std::size_t i = 0; i < times[c].size(); ++i) {
      if (times[c][i] == kExcludedTime) continue;
      const std::size_t k = nearest_tick(times[c][i]);
      const auto away = [&](std::size_t frame) {
        return std::abs(times[c][frame] - timeline.ticks[k].time_ns);
      };
      // A frame that far outside the first or last tick would belong to another tick.
      if (away(i) > timeline.tolerance || static_cast<double>(away(i)) > period / 2 + 1) continue;
      if (expected[k] < 0 || away(i) < away(static_cast<std::size_t>(expected[k]))) {
        expected[k] = static_cast<std::int32_t>(i);
      }
    }
    for (std::size_t k = 0; k < timeline.ticks.size(); ++k) {
      const FrameSelection& tick = timeline.ticks[k];
      ASSERT_EQ(tick.frame[c], expected[k]) << "camera " << c << " tick " << k;
      const Nanoseconds difference = expected[k] < 0 ? 0 : times[c][expected[k]] - tick.time_ns;
      ASSERT_EQ(tick.difference[c], difference);
    }
  }
}

void expect_truth(const Options& s, Nanoseconds margin) {
  const SimulatedStamps truth(s);
  const ResyncResult result = resynchronise(cameras_of(truth), {}, "test");
  const Timeline& timeline = result.timeline;
  const double period = 1e9 / timeline.fps;
  EXPECT_NEAR(timeline.fps, s.fps, 1e-4 * s.fps);

  // No frame is at a wrong tick. It was exposed within half a period and the margin of the tick,
  // and no other existing frame was exposed clearly nearer.
  std::vector<std::set<std::int32_t>> used(truth.cameras.size());
  for (const FrameSelection& tick : timeline.ticks) {
    for (std::size_t c = 0; c < truth.cameras.size(); ++c) {
      if (tick.frame[c] < 0) continue;
      EXPECT_TRUE(used[c].insert(tick.frame[c]).second);
      const auto& camera = truth.cameras[c];
      const auto f = static_cast<std::size_t>(tick.frame[c]);
      const Nanoseconds away = std::abs(camera.exposed[f] - tick.time_ns);
      EXPECT_LE(static_cast<double>(away), period / 2 + static_cast<double>(margin)) << c;
      EXPECT_NEAR(static_cast<double>(tick.time_ns + tick.difference[c]),
                  static_cast<double>(camera.exposed[f]), static_cast<double>(margin));
      for (std::size_t o = f - std::min<std::size_t>(f, 1);
           o < std::min(f + 2, camera.exposed.size()); ++o) {
        EXPECT_GE(std::abs(camera.exposed[o] - tick.time_ns), away - margin);
      }
    }
  }
  // A frame exposed well within a tick's interval is not absent, except for outliers.
  for (std::size_t c = 0; c < truth.cameras.size(); ++c) {
    std::set<std::int32_t> outliers;
    for (const Outlier& outlier : result.cameras[c].outliers) outliers.insert(outlier.frame);
    const auto& camera = truth.cameras[c];
    for (std::size_t f = 0; f < camera.exposed.size(); ++f) {
      const double k = static_cast<double>(camera.exposed[f] - timeline.ticks[0].time_ns) / period;
      if (k < 0 || std::round(k) > static_cast<double>(timeline.ticks.size() - 1)) continue;
      if (std::abs(k - std::round(k)) * period > period / 2 - static_cast<double>(margin)) continue;
      EXPECT_TRUE(used[c].contains(static_cast<std::int32_t>(f)) ||
                  outliers.contains(static_cast<std::int32_t>(f)))
          << "camera " << c << " frame " << f;
    }
  }

  // All frames lost between a camera's first and last frame, and no others.
  for (std::size_t c = 0; c < truth.cameras.size(); ++c) {
    const auto& index = truth.cameras[c].index;
    std::set<std::int64_t> lost, found;
    for (std::int64_t i = index.front(); i <= index.back(); ++i) lost.insert(i - index.front());
    for (const std::int64_t i : index) lost.erase(i - index.front());
    for (const LostRun& run : result.cameras[c].lost) {
      for (std::int64_t k = 0; k < run.count; ++k) found.insert(run.first + k);
    }
    EXPECT_EQ(found, lost) << "camera " << c;
  }

  ASSERT_EQ(result.steps.size(), 1u);
  EXPECT_EQ(result.steps[0].node, "node2");
  EXPECT_EQ(result.steps[0].cameras, 16);
  EXPECT_NEAR(static_cast<double>(result.steps[0].step), 40e6, 0.5e6);
  EXPECT_NEAR(static_cast<double>(result.steps[0].time), 31.2e9, period);
  ASSERT_TRUE(result.start_up_end);
  EXPECT_NEAR(static_cast<double>(*result.start_up_end), 4.0e9, 0.2e9);  // cameras start at 1 s
  EXPECT_NEAR(static_cast<double>(timeline.ticks[0].time_ns), 4.0e9, 0.3e9);
}

TEST(ResyncResult, SixtyFourCamerasWithGaussianJitter) {
  for (unsigned seed = 1; seed <= 6; ++seed) expect_truth({.seed = seed}, 2 * kMs);
}

TEST(ResyncResult, SixtyFourCamerasWithDelays) {
  for (unsigned seed = 1; seed <= 6; ++seed) {
    expect_truth({.seed = seed, .jitter = Jitter::kDelay}, kMs / 4);
  }
}

TEST(ResyncResult, TicksAreTheSlowReferences) {
  for (unsigned seed = 1; seed <= 3; ++seed) {
    const SimulatedStamps truth({.seed = seed, .cameras = 8, .cameras_per_node = 4, .seconds = 12});
    for (const bool exact : {false, true}) {
      for (const double fps : {0.0, 24.0}) {
        for (const Nanoseconds tolerance : {0 * kMs, 9 * kMs, 80 * kMs}) {
          const ResyncResult result = resynchronise(
              cameras_of(truth), {.fps = fps, .tolerance = tolerance, .trust_timestamps = exact},
              "test");
          expect_as_reference(result.timeline, result.times);
        }
      }
    }
  }
}

TEST(ResyncResult, AnyStampsGiveASoundTable) {
  rc::check([] {
    const auto cameras = *rc::gen::inRange(1, 6);
    std::vector<std::vector<Nanoseconds>> stamps;
    for (int c = 0; c < cameras; ++c) {
      auto column = *rc::gen::container<std::vector<Nanoseconds>>(
          rc::gen::inRange<Nanoseconds>(0, 3'000'000'000));
      std::ranges::sort(column);
      column.erase(std::unique(column.begin(), column.end()), column.end());
      stamps.push_back(std::move(column));
    }
    stamps[0].push_back(3'100'000'000);
    const ResyncResult result = resynchronise(cameras_at(stamps), {.nominal_fps = 15}, "test");
    RC_ASSERT(!result.timeline.ticks.empty());
    if (result.timeline.ticks.size() > 1) expect_as_reference(result.timeline, result.times);
    RC_ASSERT(!::testing::Test::HasFailure());
  });
}

TEST(ResyncResult, JournalRecordsAreCounted) {
  auto cameras = cameras_at({frames(15, 0, 60), frames(15, 3 * kMs, 60)});
  auto& stamps = cameras[1].stamps;
  FrameRecord record;
  record.status = FrameStatus::kDroppedRamFull;
  record.time_ns = stamps[21] + 2 * kMs;
  cameras[1].missing = {record};
  stamps.erase(stamps.begin() + 40);
  stamps.erase(stamps.begin() + 20, stamps.begin() + 23);
  const ResyncResult result = resynchronise(cameras, {}, "test");
  ASSERT_EQ(result.cameras[1].lost.size(), 2u);
  EXPECT_EQ(result.cameras[1].lost[0].first, 20);
  EXPECT_EQ(result.cameras[1].lost[0].count, 3);
  EXPECT_EQ(result.cameras[1].lost[0].recorded, 1);
  EXPECT_EQ(result.cameras[1].lost[1].first, 40);
  EXPECT_EQ(result.cameras[1].dropped(), 4);
  EXPECT_EQ(result.cameras[1].lost_unrecorded(), 3);
  EXPECT_FALSE(result.start_up_end);
}

TEST(ResyncResult, ALateFrameIsNamedAndLeftOut) {
  auto cameras = cameras_at({frames(15, 0, 60), frames(15, 3 * kMs, 60)});
  cameras[1].stamps[30] += 25 * kMs;
  const ResyncResult result = resynchronise(cameras, {}, "test");
  ASSERT_EQ(result.cameras[1].outliers.size(), 1u);
  EXPECT_EQ(result.cameras[1].outliers[0].frame, 30);
  EXPECT_NEAR(static_cast<double>(result.cameras[1].outliers[0].deviation), 25e6, 1e4);
  for (const FrameSelection& tick : result.timeline.ticks) EXPECT_NE(tick.frame[1], 30);
  // A time stamp that marks the exposure is used unchanged.
  const ResyncResult exact = resynchronise(cameras, {.trust_timestamps = true}, "test");
  EXPECT_EQ(exact.timeline.ticks[30].frame[1], 30);
  EXPECT_EQ(exact.times[1][30], cameras[1].stamps[30]);
}

TEST(ResyncResult, OffsetsAreTakenOff) {
  const SimulatedStamps truth({.seed = 4,
                               .cameras = 8,
                               .cameras_per_node = 4,
                               .seconds = 10,
                               .jitter_ms = 0.1,
                               .start_up_frames = 0,
                               .step_node = -1,
                               .offset_ms = 200});
  ResyncOptions options;
  for (const auto& camera : truth.cameras) {
    options.offsets.push_back(truth.node_offsets[camera.node]);
  }
  const ResyncResult result = resynchronise(cameras_of(truth), options, "test");
  for (std::size_t c = 0; c < truth.cameras.size(); ++c) {
    EXPECT_EQ(result.timeline.clocks[c].offset_ns, options.offsets[c]);
    for (std::size_t f = 0; f < truth.cameras[c].exposed.size(); ++f) {
      EXPECT_NEAR(static_cast<double>(result.times[c][f]),
                  static_cast<double>(truth.cameras[c].exposed[f]), 0.1e6);
    }
  }
}

TEST(ResyncResult, AHoleIsNoStartUp) {
  std::vector<std::vector<Nanoseconds>> stamps;
  for (int c = 0; c < 4; ++c) {
    stamps.push_back(frames(15, c * 11 * kMs, 45));
    const auto after = frames(15, 6'000 * kMs + c * 11 * kMs, 45);
    stamps.back().insert(stamps.back().end(), after.begin(), after.end());
  }
  const ResyncResult result = resynchronise(cameras_at(stamps), {}, "test");
  EXPECT_FALSE(result.start_up_end);
  EXPECT_EQ(result.cameras[0].dropped(), 45);
  EXPECT_EQ(result.timeline.ticks.size(), 135u);
}

TEST(ResyncResult, OneCameraOneFrame) {
  const ResyncResult one = resynchronise(cameras_at({{5}}), {.nominal_fps = 15}, "test");
  ASSERT_EQ(one.timeline.ticks.size(), 1u);
  EXPECT_EQ(one.timeline.ticks[0].frame, (std::vector<std::int32_t>{0}));
  const ResyncResult two =
      resynchronise(cameras_at({{5, 100'000'005}}), {.nominal_fps = 15}, "test");
  EXPECT_EQ(two.timeline.ticks.size(), 2u);
  EXPECT_THROW(resynchronise(cameras_at({{}, {}}), {}, "test"), Error);
  EXPECT_THROW(resynchronise(cameras_at({{5}}), {.fps = -1}, "test"), Error);
}

TEST(ResyncResult, OneCamera) {
  const ResyncResult result = resynchronise(cameras_at({frames(15, 7, 100)}), {}, "test");
  ASSERT_EQ(result.timeline.ticks.size(), 100u);
  EXPECT_NEAR(result.timeline.fps, 15, 1e-6);
  for (std::int32_t k = 0; k < 100; ++k) {
    EXPECT_EQ(result.timeline.ticks[k].frame[0], k);
  }
}

TEST(ResyncResult, DifferentRatesTickAtTheSlower) {
  const ResyncResult result =
      resynchronise(cameras_at({frames(30, 0, 300), frames(60, kMs, 600), frames(60, 2 * kMs, 600),
                                frames(30, 3 * kMs, 300)}),
                    {}, "test");
  EXPECT_NEAR(result.timeline.fps, 30, 1e-4);
  for (const FrameSelection& tick : result.timeline.ticks) EXPECT_EQ(tick.present(), 4);
  for (const CameraSync& camera : result.cameras) EXPECT_TRUE(camera.lost.empty());
  EXPECT_NEAR(result.timeline.clocks[1].drift_ppm, 0, 1);
  EXPECT_NEAR(result.timeline.clocks[1].period_ns, 1e9 / 60, 1);
}

TEST(ResyncResult, ACameraThatDiesIsAbsentFromThenOn) {
  const ResyncResult result = resynchronise(
      cameras_at({frames(15, 0, 300), frames(15, kMs, 150), frames(15, 2 * kMs, 300)}), {}, "test");
  ASSERT_TRUE(result.cameras[1].early_end);
  EXPECT_FALSE(result.cameras[0].early_end);
  EXPECT_TRUE(result.cameras[1].lost.empty());
  EXPECT_EQ(result.timeline.ticks.back().frame, (std::vector<std::int32_t>{299, -1, 299}));
  EXPECT_EQ(result.timeline.ticks[149].present(), 3);
  EXPECT_EQ(result.timeline.ticks[150].present(), 2);
}

// A step for each of the 4.5e15 periods, or for each of 3.6e12 lost frames, would take years.
TEST(ResyncResult, AbsurdRatesEnd) {
  EXPECT_THROW(resynchronise(cameras_at({{0, 1, 2, 8'985'600'000'000'000}}), {}, "test"), Error);
  const std::vector<Nanoseconds> late{3600 * kNanosecondsPerSecond};
  CameraSync camera;
  camera.regular = true;
  CameraClock clock;
  clock.period_ns = 1;
  EXPECT_FALSE(find_start_up_end({{camera}}, {clock}, {late}, {0, late[0]}, 1e9));
  clock.period_ns = 1e9;
  camera.lost = {{1, 4'000'000'000'000, 0}};
  EXPECT_FALSE(find_start_up_end({{camera}}, {clock}, {late}, {0, late[0]}, 1e9));
}

TEST(ResyncResult, ConstantStamps) {
  // Without any clock: all frames of a camera have one time.
  const ResyncResult result = resynchronise(
      cameras_at({std::vector<Nanoseconds>(40, 77), std::vector<Nanoseconds>(40, 77)}),
      {.nominal_fps = 15}, "test");
  ASSERT_EQ(result.timeline.ticks.size(), 1u);
  EXPECT_EQ(result.timeline.ticks[0].present(), 2);
}

TEST(ResyncResult, WholeMilliseconds) {
  std::vector<std::vector<Nanoseconds>> stamps;
  for (int c = 0; c < 16; ++c) {
    stamps.push_back(frames(30, c * 2'071'000, 900));
    for (Nanoseconds& time : stamps.back()) time = time / kMs * kMs;
  }
  const ResyncResult result = resynchronise(cameras_at(stamps), {}, "test");
  EXPECT_NEAR(result.timeline.fps, 30, 3e-4);
  EXPECT_TRUE(result.steps.empty());
  for (const CameraSync& camera : result.cameras) {
    EXPECT_TRUE(camera.lost.empty());
    EXPECT_TRUE(camera.outliers.empty());
    EXPECT_TRUE(camera.phase_steps.empty());
  }
  for (const CameraClock& clock : result.timeline.clocks) {
    EXPECT_NEAR(clock.period_ns, 1e9 / 30, 500);  // 15 ppm
  }
}

}  // namespace
}  // namespace raystage::store::resync_test
