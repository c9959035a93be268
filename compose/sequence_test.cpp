// SPDX-License-Identifier: Apache-2.0
#include "compose/sequence.h"

#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfInputFile.h>
#include <OpenEXR/ImfMultiPartInputFile.h>
#include <OpenEXR/ImfStringVectorAttribute.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <tbb/global_control.h>
#include <tbb/task_arena.h>

#include "base/atomic_file.h"
#include "base/cancellation.h"
#include "images/exr_reader.h"
#include "schemas/rig_document.h"
#include "testing/compose/sequence_test_data.h"

namespace raystage::compose {
namespace {

using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

using testing::kTicks;
using testing::wall_shot;

class Sequence : public testing::SequenceTest {};

TEST_F(Sequence, RendersEveryFrameAtItsTime) {
  const SequenceReport report = run();
  EXPECT_EQ(report.exit_code(), ExitCode::kSuccess);
  EXPECT_EQ(report.rendered, 6);
  EXPECT_EQ(files(), 6) << "and nothing temporary";
  EXPECT_EQ(progress_, 1);
  EXPECT_THAT(report.summary(), HasSubstr("6 of 6 frames rendered"));
  for (int tick = 0; tick < kTicks; ++tick) {
    const auto [value, alpha] = middle(101 + tick);
    EXPECT_NEAR(value, grey(tick), 0.005F) << tick;
    EXPECT_NEAR(alpha, 1, 1e-3F);
  }
}

TEST_F(Sequence, StartAndSpeedChooseTheInstant) {
  schemas::ShotDocument::Layer& layer = shot_.layers[0];
  layer.start_seconds = 0.5;
  layer.speed = -0.5;
  run();
  EXPECT_NEAR(middle(101).first, grey(5), 0.005F);
  EXPECT_NEAR(middle(103).first, grey(4), 0.005F);
  EXPECT_NEAR(middle(105).first, grey(3), 0.005F);
}

TEST_F(Sequence, TimeKeysChooseTheInstant) {
  shot_.layers[0].time_keys = {{101, 0}, {103, 0.4}, {104, 0.4}, {106, 0.1}};
  run();
  EXPECT_NEAR(middle(101).first, grey(0), 0.005F);
  EXPECT_NEAR(middle(103).first, grey(4), 0.005F);
  EXPECT_NEAR(middle(104).first, grey(4), 0.005F);
  EXPECT_NEAR(middle(106).first, grey(1), 0.005F);
}

TEST_F(Sequence, FramesOutsideTheShotAreLeftOutAndSaid) {
  options_.frames = {95, 102, 104, 106, 110};
  EXPECT_EQ(run().rendered, 3);
  EXPECT_EQ(files(), 3);
  EXPECT_THAT(messages_, Contains(HasSubstr("2 requested frames are outside")));
  options_.frames = {1, 2};
  EXPECT_THAT(refusal(), HasSubstr("none of the frames 1-2"));
}

TEST_F(Sequence, ATakeOfOneInstantIsAStill) {
  const store::Take take(folder_.path() / "take");
  store::Timeline timeline = store::build_timeline(take, 10, 0);
  timeline.ticks.resize(1);
  store::write_timeline(timeline, take.folder());
  EXPECT_EQ(run().rendered, 6);
  EXPECT_NEAR(middle(106).first, grey(0), 0.005F);
}

TEST_F(Sequence, WhatTheTakeLacksIsAnErrorHeldOrBlack) {
  shot_.last_frame = 108;
  EXPECT_THAT(refusal(), HasSubstr("2 of 8 frames (107-108)"));
  EXPECT_EQ(files(), 0);
  options_.missing = MissingFrames::kHold;
  EXPECT_EQ(run().exit_code(), ExitCode::kSuccess);
  EXPECT_NEAR(middle(108).first, grey(5), 0.005F);
  EXPECT_THAT(messages_, Contains(HasSubstr("2 frames show the nearest instant")));
  options_.missing = MissingFrames::kBlack;
  options_.existing = ExistingFiles::kSkip;
  EXPECT_EQ(run().rendered, 2) << "the fingerprint knows the difference";
  EXPECT_EQ(middle(108).second, 0);
  EXPECT_EQ(middle(106).second, 1);

  shot_.layers[0].start_seconds = -0.2;
  options_.missing = MissingFrames::kHold;
  run();
  EXPECT_NEAR(middle(101).first, grey(0), 0.005F) << "held from after, where nothing is before";
}

TEST_F(Sequence, CoverageMeasuresAreChannelsOnRequest) {
  options_.frames = {101};
  const auto channels = [&] {
    const Imf::MultiPartInputFile input(file(101).c_str());
    std::vector<std::string> names;
    for (int part = 0; part < input.parts(); ++part) {
      const Imf::ChannelList& list = input.header(part).channels();
      for (auto it = list.begin(); it != list.end(); ++it) names.emplace_back(it.name());
    }
    return names;
  };
  run();
  EXPECT_THAT(channels(), ElementsAre("A", "B", "G", "R", "Z", "coverage.V"));
  options_.existing = ExistingFiles::kSkip;
  options_.aovs = {"lf.cameras", "lf.nearest"};
  EXPECT_EQ(run().rendered, 1) << "the fingerprint knows the difference";
  EXPECT_THAT(channels(),
              ElementsAre("A", "B", "G", "R", "Z", "cameras.V", "coverage.V", "nearest.V"));
  constexpr images::ExrChannel kMeasures[] = {{"cameras.V"}, {"nearest.V"}};
  const std::vector<float> both = images::read_exr_channels(file(101), kMeasures, "").values;
  std::vector<float> cameras, nearest;
  for (std::size_t i = 0; i < both.size(); i += 2) {
    cameras.push_back(both[i]);
    nearest.push_back(both[i + 1]);
  }
  EXPECT_GT(cameras[15 * 40 + 20], 1.5F);
  EXPECT_LE(cameras[15 * 40 + 20], 3.0F);
  EXPECT_GT(nearest[15 * 40 + 20], 0.02F);
  EXPECT_LT(nearest[15 * 40 + 20], 0.06F);
}

TEST_F(Sequence, SameBytesForAnyNumberOfThreadsAndFramesInFlight) {
  std::vector<std::string> first;
  for (const int threads : {1, 2, 5}) {
    options_.existing = ExistingFiles::kOverwrite;
    options_.frames_in_flight = threads * 2 - 1;
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism,
                                    static_cast<std::size_t>(threads));
    tbb::task_arena arena(threads);
    EXPECT_EQ(arena.execute([&] { return run(); }).rendered, 6);
    std::vector<std::string> bytes;
    for (int frame = 101; frame <= 106; ++frame) bytes.push_back(read_file(file(frame)));
    if (first.empty()) first = bytes;
    EXPECT_EQ(bytes, first) << threads << " threads";
  }
}

TEST_F(Sequence, AStopDropsWhatIsUnderWay) {
  std::stop_source source;
  options_.frames_in_flight = 1;
  options_.progress = [&](double done) {
    if (done > 0.2) source.request_stop();
  };
  const SequenceReport report = run(source.get_token());
  EXPECT_EQ(report.status, RunStatus::kStopped);
  EXPECT_EQ(report.exit_code(), ExitCode::kFailed);
  EXPECT_LT(report.rendered, 6);
  EXPECT_EQ(files(), report.rendered);
}

TEST_F(Sequence, AStopBeforeTheFirstFrameLeavesNoFile) {
  std::stop_source source;
  source.request_stop();
  EXPECT_THROW(run(source.get_token()), Cancelled);
  EXPECT_EQ(files(), 0);
}

TEST_F(Sequence, ADraftHasItsOwnSizeCamerasAndFingerprint) {
  options_.frames = {101};
  options_.existing = ExistingFiles::kSkip;
  EXPECT_EQ(run().rendered, 1);
  options_.draft.scale = 0.5;
  EXPECT_EQ(run().rendered, 1);
  EXPECT_EQ(read_exr(file(101)).width, 20);
  EXPECT_EQ(read_exr(file(101)).height, 15);
  options_.draft = {};
  options_.draft.camera_step = 2;  // one of 2 x 2 cameras
  EXPECT_THAT(refusal(), HasSubstr("camera 'c0' has no row and column in the rig's grid"));
  const auto rig = folder_.path() / "take" / "rig.json";
  schemas::RigDocument document = schemas::read_rig(rig);
  for (int i = 0; i < testing::kCameras; ++i) {
    document.cameras[i].geometry.row = i / 2;
    document.cameras[i].geometry.column = i % 2;
  }
  schemas::write_rig(document, rig);
  EXPECT_EQ(run().rendered, 1);
  const Imf::InputFile input(file(101).c_str());
  EXPECT_EQ(input.header().typedAttribute<Imf::StringVectorAttribute>("lf:absentCameras").value(),
            (std::vector<std::string>{"c1", "c2", "c3"}));
  options_.draft = {};
  EXPECT_EQ(run().rendered, 1);
  EXPECT_EQ(default_output("p/shot.json", shot_, true), "p/renders/sh_draft.####.exr");
  shot_.layers.push_back(shot_.layers.front());
  shot_.layers[0] = shot_.layers[1];
  shot_.layers[0].name = "set";
  shot_.layers[1].name = "cube";
  EXPECT_EQ(default_output("p/shot.json", shot_, true), "p/renders/sh_set_draft.####.exr");
  shot_.layers[0].opacity = 0;
  EXPECT_EQ(default_output("p/shot.json", shot_, true), "p/renders/sh_cube_draft.####.exr");
}

TEST(DefaultOutput, StandsBesideTheShotAndIsOneSafeName) {
  schemas::ShotDocument shot = wall_shot();
  shot.layers[0].name = "lf/beauty #1";
  EXPECT_EQ(default_output("p/shot.json", shot), "p/renders/sh_lf_beauty__1.####.exr");
  shot.name = shot.layers[0].name = "";
  EXPECT_EQ(default_output("shot.json", shot), "renders/shot.####.exr");
}

}  // namespace
}  // namespace raystage::compose
