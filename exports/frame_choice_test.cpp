// SPDX-License-Identifier: Apache-2.0
#include "exports/frame_choice.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "base/error.h"
#include "testing/exports/export_test_data.h"

namespace raystage::exports::frame_choice_test {
namespace {

using ::testing::ElementsAre;
using testing::ExportTake;
using ::testing::HasSubstr;

std::vector<int> sources(const CameraFrames& camera) {
  std::vector<int> result;
  for (const ChosenFrame& frame : camera.frames) result.push_back(frame.source);
  return result;
}
std::vector<int> numbers(const CameraFrames& camera) {
  std::vector<int> result;
  for (const ChosenFrame& frame : camera.frames) result.push_back(frame.number);
  return result;
}
template <class Function>
std::string error_of(const Function& function) {
  try {
    function();
  } catch (const Error& error) {
    EXPECT_EQ(error.exit_code(), ExitCode::kBadInput);
    return error.what();
  }
  return "no error";
}

TEST(FrameChoice, RecordedTimesAreTheTimeStamps) {
  const ExportTake data(false);  // needs no timeline
  const store::Take take = data.take();
  const FrameChoice choice = choose_frames(take, {});
  ASSERT_EQ(choice.cameras.size(), 3);
  EXPECT_EQ(choice.frames(), 8 + 7 + 6);
  EXPECT_EQ(choice.origin_ns, 0);
  for (const CameraFrames& camera : choice.cameras) {
    std::size_t i = 0;
    for (int frame = 0; frame < ExportTake::kFrames; ++frame) {
      if (!ExportTake::has_frame(camera.camera, frame)) continue;
      EXPECT_EQ(camera.frames.at(i).time_ns, ExportTake::time_of(camera.camera, frame));
      EXPECT_EQ(camera.frames.at(i).source_ns, camera.frames.at(i).time_ns);
      EXPECT_EQ(camera.frames.at(i).source, static_cast<int>(i));
      EXPECT_FALSE(camera.frames.at(i).is_held);
      ++i;
    }
    EXPECT_EQ(i, camera.frames.size());
  }
  EXPECT_EQ(choice.cameras[1].absent, 1);  // recorded as dropped
  EXPECT_EQ(choice.cameras[2].absent, 0);  // nothing in the journal says so
}

TEST(FrameChoice, TheOutputMayBeginAtTheFirstFrame) {
  const ExportTake data;
  FrameChoiceOptions options;
  options.starts_at_zero = true;
  options.cameras = {"c2", "c1"};
  const FrameChoice choice = choose_frames(data.take(), options);
  EXPECT_EQ(choice.cameras[0].camera, 2);
  EXPECT_EQ(choice.cameras[1].frames.front().time_ns, 0);
  EXPECT_EQ(choice.origin_ns, ExportTake::time_of(1, 0));
  EXPECT_EQ(choice.cameras[0].frames.front().time_ns,
            ExportTake::time_of(2, 0) - ExportTake::time_of(1, 0));
}

TEST(FrameChoice, ConstantTimesHaveAFramePerTick) {
  const ExportTake data;
  const store::Take take = data.take();
  FrameChoiceOptions options;
  options.times = FrameTimes::kConstant;
  const FrameChoice choice = choose_frames(take, options);
  EXPECT_EQ(choice.fps, 15);
  for (const CameraFrames& camera : choice.cameras) {
    ASSERT_EQ(camera.frames.size(), 8) << camera.camera;
    for (int n = 0; n < 8; ++n) {
      EXPECT_EQ(camera.frames[n].number, n + 1);
      EXPECT_EQ(camera.frames[n].time_ns, std::llround(n * 1e9 / 15));
    }
  }
  // The previous frame stands for an absent one.
  EXPECT_THAT(sources(choice.cameras[0]), ElementsAre(0, 1, 2, 3, 4, 5, 6, 7));
  EXPECT_THAT(sources(choice.cameras[1]), ElementsAre(0, 1, 2, 2, 3, 4, 5, 6));
  EXPECT_THAT(sources(choice.cameras[2]), ElementsAre(0, 1, 2, 3, 3, 3, 4, 5));
  EXPECT_EQ(choice.cameras[2].absent, 2);
  EXPECT_TRUE(choice.cameras[2].frames[5].is_held);
  EXPECT_FALSE(choice.cameras[2].frames[6].is_held);
  EXPECT_EQ(choice.cameras[2].frames[5].source_ns, ExportTake::time_of(2, 3));

  options.absent = AbsentFrames::kBlack;
  EXPECT_THAT(sources(choose_frames(take, options).cameras[1]),
              ElementsAre(0, 1, 2, -1, 3, 4, 5, 6));
  options.absent = AbsentFrames::kGap;
  EXPECT_THAT(numbers(choose_frames(take, options).cameras[1]), ElementsAre(1, 2, 3, 5, 6, 7, 8));
  options.absent = AbsentFrames::kError;
  EXPECT_THAT(error_of([&] { choose_frames(take, options); }),
              HasSubstr("camera \"c1\" has no frame at frame 4 (tick 3)"));
}

TEST(FrameChoice, TheNextFrameStandsWhereThereIsNoneBefore) {
  const ExportTake data;
  FrameChoiceOptions options;
  options.times = FrameTimes::kConstant;
  options.frames = std::vector{5, 6, 7};
  options.cameras = {"c2"};
  const FrameChoice choice = choose_frames(data.take(), options);
  EXPECT_THAT(sources(choice.cameras[0]), ElementsAre(4, 4, 4));
  EXPECT_THAT(numbers(choice.cameras[0]), ElementsAre(5, 6, 7));
  EXPECT_TRUE(choice.cameras[0].frames[0].is_held);
}

TEST(FrameChoice, OtherRatesShowTheNearestTick) {
  const ExportTake data;
  FrameChoiceOptions options;
  options.times = FrameTimes::kConstant;
  options.cameras = {"c0"};
  options.fps = 30;
  FrameChoice choice = choose_frames(data.take(), options);
  ASSERT_EQ(choice.cameras[0].frames.size(), 16);
  // At a tie the earlier tick: frame 1 is halfway between two ticks.
  EXPECT_EQ(choice.cameras[0].frames[0].source, 0);
  EXPECT_EQ(choice.cameras[0].frames[2].source, 1);
  EXPECT_EQ(choice.cameras[0].frames[14].source, 7);
  EXPECT_EQ(choice.cameras[0].frames[15].source, 7);
  EXPECT_EQ(choice.cameras[0].frames[15].time_ns, 500'000'000);
  options.fps = 5;
  choice = choose_frames(data.take(), options);
  EXPECT_THAT(sources(choice.cameras[0]), ElementsAre(0, 3, 6));
  EXPECT_THAT(numbers(choice.cameras[0]), ElementsAre(1, 2, 3));
}

TEST(FrameChoice, RangesAreOfTimesAndOfTicks) {
  const ExportTake data;
  const store::Take take = data.take();
  FrameChoiceOptions options;
  options.cameras = {"c0"};
  options.from_s = ExportTake::time_of(0, 2) / 1e9;
  options.to_s = ExportTake::time_of(0, 4) / 1e9;
  EXPECT_THAT(sources(choose_frames(take, options).cameras[0]), ElementsAre(2, 3, 4));
  options.from_s = options.to_s = {};
  options.frames = std::vector{2, 8};
  EXPECT_THAT(sources(choose_frames(take, options).cameras[0]), ElementsAre(1, 7));
  options.cameras = {"c2"};  // has no frame at ticks 4 and 5
  EXPECT_THAT(sources(choose_frames(take, options).cameras[0]), ElementsAre(1, 5));
}

TEST(FrameChoice, SynchronisedTimesAreWithoutTheClocksErrors) {
  const ExportTake data;
  const store::Take take = data.take();
  store::Timeline timeline = store::read_timeline(take);
  timeline.clocks.assign(3, {});
  timeline.clocks[1].offset_ns = 5'000'000;
  for (store::FrameSelection& tick : timeline.ticks) {
    if (tick.frame[1] >= 0) tick.difference[1] -= 5'000'000;
  }
  store::write_timeline(timeline, take);
  FrameChoiceOptions options;
  options.times = FrameTimes::kSynchronised;
  const FrameChoice choice = choose_frames(take, options);
  EXPECT_EQ(choice.cameras[0].frames[3].time_ns, ExportTake::time_of(0, 3));
  EXPECT_EQ(choice.cameras[1].frames[2].time_ns, ExportTake::time_of(1, 2) - 5'000'000);
  EXPECT_EQ(choice.cameras[1].frames[2].source_ns, ExportTake::time_of(1, 2));
}

TEST(FrameChoice, WhatIsWrongIsNamed) {
  const ExportTake data(false);
  const store::Take take = data.take();
  FrameChoiceOptions options;
  options.cameras = {"c7"};
  EXPECT_THAT(error_of([&] { choose_frames(take, options); }),
              HasSubstr("the take has no camera \"c7\""));
  options.cameras = {"c1", "c1"};
  EXPECT_THAT(error_of([&] { choose_frames(take, options); }), HasSubstr("given twice"));
  options.cameras = {};
  options.from_s = 50;
  EXPECT_THAT(error_of([&] { choose_frames(take, options); }), HasSubstr("no frame"));
  options.to_s = 49;
  EXPECT_THAT(error_of([&] { choose_frames(take, options); }), HasSubstr("is empty"));
  options = {};
  options.fps = NAN;
  EXPECT_THAT(error_of([&] { choose_frames(take, options); }), HasSubstr("fps is nan"));
}

}  // namespace
}  // namespace raystage::exports::frame_choice_test
