// SPDX-License-Identifier: Apache-2.0
// Tests of takes whose recorder was killed and resumed, and of cameras with long gaps.
#include <gtest/gtest.h>

#include <cmath>
#include <set>

#include "store/processing/sync/resync.h"
#include "store/processing/sync/resync_report.h"
#include "testing/store/simulated_stamps.h"

namespace raystage::store::resumed_test {
namespace {

using testing::resumed;
using testing::SimulatedStamps;
using Options = SimulatedStamps::Options;

constexpr Nanoseconds kMs = 1'000'000, kS = 1'000'000'000;

Options session(unsigned seed) {
  return {.seed = seed,
          .cameras = 16,
          .cameras_per_node = 4,
          .seconds = 20,
          .jitter_ms = 2,
          .start_up_frames = 0,
          .step_node = -1};
}

struct Resumed {
  SimulatedStamps first, second;
  Nanoseconds behind;
  std::vector<CameraTimestamps> cameras;
  Resumed(const Options& a, const Options& b, Nanoseconds later)
      : first(a), second(b), behind(later), cameras(resumed(first, second, later)) {}

  void expect_exposures(const ResyncResult& result, Nanoseconds margin) const {
    for (std::size_t c = 0; c < cameras.size(); ++c) {
      std::vector<Nanoseconds> exposed = first.cameras[c].exposed;
      for (const Nanoseconds time : second.cameras[c].exposed) exposed.push_back(time + behind);
      ASSERT_EQ(result.times[c].size(), exposed.size());
      for (std::size_t f = 0; f < exposed.size(); ++f) {
        if (result.times[c][f] == kExcludedTime) continue;
        ASSERT_LE(std::abs(result.times[c][f] - exposed[f]), margin) << c << " frame " << f;
      }
    }
  }
};

std::int64_t lost_of(const SimulatedStamps::Camera& camera) {
  return camera.index.back() - camera.index.front() + 1 -
         static_cast<std::int64_t>(camera.index.size());
}

TEST(ResumedTake, EverySessionHasItsOwnPhases) {
  for (const double pause : {0.4, 7.3, 700.0}) {
    for (unsigned seed = 1; seed <= 3; ++seed) {
      const Resumed take(session(seed), session(seed + 50),
                         20 * kS + static_cast<Nanoseconds>(pause * 1e9));
      const ResyncResult result = resynchronise(take.cameras, {}, "test");
      take.expect_exposures(result, 2 * kMs);
      EXPECT_NEAR(result.timeline.fps, 15, 1e-3);
      EXPECT_TRUE(result.steps.empty());
      for (std::size_t c = 0; c < take.cameras.size(); ++c) {
        EXPECT_TRUE(result.cameras[c].phase_steps.empty());
        EXPECT_EQ(result.cameras[c].dropped(),
                  lost_of(take.first.cameras[c]) + lost_of(take.second.cameras[c]));
      }
      ASSERT_EQ(result.pauses.size(), 4u);
      for (const RecordingPause& p : result.pauses) {
        EXPECT_NEAR(static_cast<double>(p.end - p.begin) / 1e9, pause, 0.2);
      }
    }
  }
}

TEST(ResumedTake, AClockStaysWhereItSteppedTo) {
  Options first = session(7), second = session(8);
  first.step_node = 2;
  first.step_ms = 30;
  first.step_at_s = 11;
  const Resumed as_it_was(first, second, 25 * kS);
  Resumed take = as_it_was;
  for (std::size_t c = 8; c < 12; ++c) {
    auto& stamps = take.cameras[c].stamps;
    for (std::size_t f = take.first.cameras[c].stamps.size(); f < stamps.size(); ++f) {
      stamps[f] += 30 * kMs;
    }
  }
  const ResyncResult result = resynchronise(take.cameras, {}, "test");
  take.expect_exposures(result, 3 * kMs);
  ASSERT_EQ(result.steps.size(), 1u);
  EXPECT_EQ(result.steps[0].cameras, 4);
  for (std::size_t c = 0; c < 16; ++c) {
    const CameraClock& clock = result.timeline.clocks[c];
    EXPECT_EQ(clock.steps.size(), c / 4 == 2 ? 1u : 0u);
    for (std::size_t f = 0; f < take.cameras[c].stamps.size(); ++f) {
      if (result.times[c][f] == kExcludedTime) continue;
      EXPECT_NEAR(static_cast<double>(clock.corrected(take.cameras[c].stamps[f])),
                  static_cast<double>(result.times[c][f]), 25e6);
    }
  }
}

TEST(ResumedTake, AStepIsFoundInTheSecondSessionToo) {
  Options second = session(10);
  second.step_node = 1;
  second.step_ms = 30;
  second.step_at_s = 9;
  const Resumed take(session(9), second, 30 * kS);
  const ResyncResult result = resynchronise(take.cameras, {}, "test");
  take.expect_exposures(result, 3 * kMs);
  ASSERT_EQ(result.steps.size(), 1u);
  EXPECT_EQ(result.steps[0].node, "node1");
  EXPECT_NEAR(static_cast<double>(result.steps[0].time), 39e9, 0.1e9);
}

TEST(ResumedTake, TheVerdictNamesThePause) {
  const Resumed take(session(1), session(2), 30 * kS);
  const ResyncResult result = resynchronise(take.cameras, {}, "test");
  int named = 0;
  for (const std::string& sentence : resync_findings(result, std::nullopt)) {
    named += sentence.starts_with("Recording on node") ? 1 : 0;
  }
  EXPECT_EQ(named, 4);
}

// Only the camera restarted, not the recorder: its losses count, and its rate is not distorted.
TEST(ResumedTake, ACameraThatWasAwayForLong) {
  for (const double phase : {0.0, 0.3, 0.5, 0.8}) {
    const SimulatedStamps truth(session(3));
    std::vector<CameraTimestamps> cameras = testing::cameras_of(truth);
    auto& stamps = cameras[5].stamps;
    std::vector<Nanoseconds> before, after;
    for (const Nanoseconds stamp : stamps) {
      if (stamp < 7 * kS) before.push_back(stamp);
      if (stamp > 15 * kS) after.push_back(stamp + std::llround(phase / 15 * 1e9));
    }
    stamps = before;
    stamps.insert(stamps.end(), after.begin(), after.end());
    const ResyncResult result = resynchronise(cameras, {}, "test");
    EXPECT_NEAR(1e9 / result.timeline.clocks[5].period_ns, 15, 0.01);
    EXPECT_TRUE(result.steps.empty());
    EXPECT_TRUE(result.pauses.empty());
    std::int64_t longest = 0;
    for (const LostRun& run : result.cameras[5].lost) longest = std::max(longest, run.count);
    EXPECT_NEAR(static_cast<double>(longest), 120 + phase, 2) << phase;
    std::size_t used = 0;
    for (const FrameSelection& tick : result.timeline.ticks) used += tick.frame[5] >= 0 ? 1 : 0;
    EXPECT_GE(used, stamps.size() - 3);
  }
}

}  // namespace
}  // namespace raystage::store::resumed_test
