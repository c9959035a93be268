// SPDX-License-Identifier: Apache-2.0
// Frames at their exact times between the ticks of a take. The wall gets brighter from tick to
// tick, so that a picture's grey states its time.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <tbb/task_arena.h>

#include <cmath>

#include "base/atomic_file.h"
#include "compose/derived_data.h"
#include "testing/compose/sequence_test_data.h"

namespace raystage::compose {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using Time = schemas::ShotDocument::Layer::Time;

class ExactTime : public testing::SequenceTest {
 protected:
  ExactTime() {
    shot_.fps = shot_.fps_numerator = 24;
    shot_.last_frame = 112;
    shot_.layers.front().time = Time::kExact;
    options_.existing = ExistingFiles::kOverwrite;
  }

  /// Returns the ticks since the first one that a frame's grey states.
  double ticks_shown(int frame) const {
    const double code = 255 * srgb_from_linear(middle(frame).first);
    return (code - testing::kFirstGrey) / testing::kStep;
  }
  /// Returns the instants that the frames of the shot show.
  std::vector<int> instants() {
    schemas::write_shot(shot_, shot_file());
    const ShotPlan plan(shot_file());
    std::vector<int> shown;
    for (int frame = shot_.first_frame; frame <= shot_.last_frame; ++frame) {
      shown.push_back(*plan.light_field(0)->shown_tick_at(frame, MissingFrames::kError).tick);
    }
    return shown;
  }
};

TEST_F(ExactTime, FramesShowTheirTimes) {
  EXPECT_EQ(run().rendered, 12);
  for (int frame = 101; frame <= 112; ++frame) {
    EXPECT_NEAR(ticks_shown(frame), (frame - 101) / 2.4, 0.06) << frame;
  }
  shot_.layers.front().time = Time::kTick;
  run();
  EXPECT_NEAR(ticks_shown(102), 0, 0.06);
  EXPECT_NEAR(ticks_shown(103), 1, 0.06);
}

// Slow motion, backwards: every frame differs.
TEST_F(ExactTime, OfSlowMotion) {
  shot_.layers.front().speed = -0.3;
  shot_.layers.front().start_seconds = 0.4;
  run();
  for (int frame = 101; frame <= 112; ++frame) {
    EXPECT_NEAR(ticks_shown(frame), 4 - 0.3 * (frame - 101) / 2.4, 0.06) << frame;
  }
}

TEST_F(ExactTime, TicksStayAsTheyWereRecorded) {
  // Frames 101 and 113 are at ticks 0 and 5; tick 5 is the last one.
  EXPECT_THAT(instants(), ElementsAre(0, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17));
  shot_.fps = shot_.fps_numerator = 10;
  shot_.last_frame = 106;
  // At tick 2 a camera lost its frame, which is interpolated.
  EXPECT_THAT(instants(), ElementsAre(0, 1, 8, 3, 4, 5));
  shot_.layers.front().time = Time::kTick;
  EXPECT_THAT(instants(), ElementsAre(0, 1, 2, 3, 4, 5));
}

// Frames of one time share their instant, with its depths.
TEST_F(ExactTime, FrozenFramesShareAnInstant) {
  shot_.layers.front().time_keys = {{101, 0}, {104, 0.07}, {111, 0.07}, {112, 0.1}};
  EXPECT_THAT(instants(), ElementsAre(0, 7, 8, 9, 9, 9, 9, 9, 9, 9, 9, 1));
  shot_.layers.front().time_keys = {};
  shot_.layers.front().speed = 0;
  shot_.layers.front().start_seconds = 0.26;
  for (const int instant : instants()) EXPECT_EQ(instant, 6);
}

TEST_F(ExactTime, TheLastInstantIsShownAsTicksAre) {
  shot_.layers.front().start_seconds = 0.1;
  shot_.last_frame = 111;  // half a tick after the last one
  run();
  EXPECT_NEAR(ticks_shown(110), 1 + 9 / 2.4, 0.06);
  EXPECT_NEAR(ticks_shown(111), 5, 0.06);
  shot_.last_frame = 113;
  EXPECT_THAT(refusal(), HasSubstr("no instant"));
}

// Rows cannot be moved by a line time of nanoseconds. Frames as recorded do not depend on it.
TEST_F(ExactTime, LineTimesThatNoFrameHasAreRefused) {
  const std::filesystem::path file = folder_.path() / "take" / "rig.json";
  schemas::RigDocument rig = schemas::read_rig(file);
  for (const double line_time_us : {1e5 / rig.cameras[1].geometry.height, 10'000.0}) {
    rig.cameras[1].geometry.line_time_us = line_time_us;
    schemas::write_rig(rig, file);
    if (line_time_us < 10'000) {
      EXPECT_EQ(instants().size(), 12U);
      continue;
    }
    EXPECT_THAT(refusal(), AllOf(HasSubstr("rig.json: camera " + rig.cameras[1].geometry.id),
                                 HasSubstr("10000 us"), HasSubstr("Correct line_time_us")));
  }
  shot_.layers.front().time = Time::kTick;
  EXPECT_EQ(instants().size(), 12U);
}

// All cameras lost tick 3: it is between ticks 2 and 4.
TEST_F(ExactTime, BridgesATickThatAllCamerasLost) {
  const store::Take take(folder_.path() / "take");
  store::Timeline timeline = store::read_timeline(take);
  std::ranges::fill(timeline.ticks[3].frame, -1);
  std::ranges::fill(timeline.ticks[3].difference, 0);
  store::write_timeline(timeline, folder_.path() / "take");
  run();
  EXPECT_NEAR(ticks_shown(108), 7 / 2.4, 0.06);
  shot_.layers.front().time = Time::kTick;
  EXPECT_THAT(refusal(), HasSubstr("no instant"));
}

TEST_F(ExactTime, MethodsWithMattesOfRecordedFramesAreRefused) {
  shot_.layers.front().method = "visual_hull";
  EXPECT_THAT(refusal(), HasSubstr("exact times have none"));
}

TEST_F(ExactTime, HoldsMoreDecodedFrames) {
  schemas::write_shot(shot_, shot_file());
  const std::size_t exact = ShotPlan(shot_file()).light_field(0)->decoded_frame_bytes();
  shot_.layers.front().time = Time::kTick;
  schemas::write_shot(shot_, shot_file());
  EXPECT_GE(exact, 3 * ShotPlan(shot_file()).light_field(0)->decoded_frame_bytes());
}

TEST_F(ExactTime, BytesDoNotDependOnThreadsAndOrder) {
  shot_.layers.front().method = "plane_sweep";
  run();
  std::vector<std::string> bytes;
  for (int frame = 101; frame <= 112; ++frame) bytes.push_back(read_file(file(frame)));
  options_.frames_in_flight = 3;
  tbb::task_arena(3).execute([&] { run(); });
  for (int frame = 101; frame <= 112; ++frame) {
    EXPECT_TRUE(read_file(file(frame)) == bytes[static_cast<std::size_t>(frame - 101)]) << frame;
  }
}

TEST_F(ExactTime, FilesOfOtherTimesAreOutOfDate) {
  run();
  options_.existing = ExistingFiles::kSkip;
  EXPECT_EQ(run().rendered, 0);
  shot_.layers.front().start_seconds = 0.001;
  EXPECT_EQ(run().rendered, 12);
  shot_.layers.front().time = Time::kTick;
  EXPECT_GE(run().rendered, 10);
}

TEST_F(ExactTime, DepthsAreStoredForEachInstant) {
  shot_.layers.front().method = "depth";
  shot_.last_frame = 104;
  schemas::write_shot(shot_, shot_file());
  ShotPlanOptions settings;
  settings.cache_folder = folder_.path() / "prepared";
  const ShotPlan plan(shot_file(), settings);
  const std::vector<int> frames{101, 102, 103, 104};
  const std::vector<PlannedFrame> planned = plan.plan(frames, MissingFrames::kError);
  const std::vector<DerivedFrameData> needed = list_derived_data(plan, planned);
  ASSERT_EQ(needed.size(), 4U);
  // A task of a farm lists only its own.
  const std::vector<LayerTick> own{{0, needed[2].tick}};
  EXPECT_EQ(list_derived_data(plan, planned, own).at(0).file, needed[2].file);
  EXPECT_EQ(prepare_derived_data(plan, needed, {}, {}).derived, 4);
  options_.cache_folder = settings.cache_folder;
  EXPECT_EQ(run().light_field_frames_estimated, 0);
}

}  // namespace
}  // namespace raystage::compose
