// SPDX-License-Identifier: Apache-2.0
#include "compose/sequence_memory_plan.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "schemas/shot_document.h"
#include "testing/compose/test_camera_key.h"
#include "testing/render/synthetic_take.h"

namespace raystage::compose {
namespace {

constexpr int kFrames = 8;
constexpr std::size_t kInstant = std::size_t{25} * 640 * 480 * 8;  // 61 MB

class Memory : public ::testing::Test {
 protected:
  void SetUp() override {
    testing::SyntheticTake settings;
    settings.cameras = testing::camera_grid(5, 5, 0.1, 640, 480);
    settings.frames = kFrames;
    settings.depth_range = schemas::DepthRange{2, 8};
    write_synthetic_take(settings, folder_.path() / "take");
    store::write_timeline(store::build_timeline(store::Take(folder_.path() / "take"), 15, 0),
                          folder_.path() / "take");
    shot_.width = 640;
    shot_.height = 480;
    shot_.fps = shot_.fps_numerator = 15;
    shot_.first_frame = 1;
    shot_.last_frame = kFrames;
    shot_.camera.keys.push_back(testing::camera_key(1, {0, 0, 0}, 60));
    schemas::ShotDocument::Layer layer;
    layer.take = "take";
    shot_.layers.push_back(layer);
  }

  SequenceMemoryPlan planned(std::size_t megabytes, int frames_in_flight = 4) {
    schemas::write_shot(shot_, folder_.path() / "shot.json");
    const ShotPlan plan(folder_.path() / "shot.json");
    std::vector<int> frames;
    for (int frame = 1; frame <= kFrames; ++frame) frames.push_back(frame);
    return plan_sequence_memory(plan, plan.plan(frames, MissingFrames::kError),
                                {megabytes * 1'000'000, frames_in_flight});
  }

  testing::TestFolder folder_;
  schemas::ShotDocument shot_;
};

TEST_F(Memory, IsSharedOutAndNoMore) {
  constexpr std::size_t kView = std::size_t{640} * 480 * 96;       // 29 MB
  constexpr std::size_t kFiles = std::size_t{640} * 480 * 16 * 2;  // on their way to the disk
  for (const char* method : {"focal_plane", "depth"}) {
    shot_.layers[0].method = method;
    for (const std::size_t megabytes : {130, 200, 400, 4000}) {
      const SequenceMemoryPlan plan = planned(megabytes);
      const auto frames_in_flight = static_cast<std::size_t>(plan.frames_in_flight);
      EXPECT_LE(frames_in_flight * (kView + plan.working) + kFiles + plan.result_cache + plan.cache,
                megabytes * 1'000'000);
      EXPECT_EQ(plan.result_cache == 0, std::string(method) == "focal_plane");
    }
    EXPECT_EQ(planned(4000).frames_in_flight, 4);
    EXPECT_EQ(planned(4000).note, "");
  }
}

TEST_F(Memory, IsThereForADepthMapAlthoughApertureWorksInLittle) {
  shot_.layers[0].method = "aperture";
  EXPECT_EQ(planned(400).result_cache, 0);
  shot_.layers[0].options = {{"depth_map", std::string("z.exr")}};
  EXPECT_GE(planned(400).result_cache, sizeof(float) * 640 * 480);
}

TEST_F(Memory, HasRoomForTheFramesThatViewsLookThrough) {
  EXPECT_EQ(planned(185).frames_in_flight, 1);
  EXPECT_EQ(planned(195).frames_in_flight,
            2);  // 59 MB of views, 10 of files, 123 of decoded frames
  EXPECT_GE(planned(195).cache, 2 * kInstant);
  EXPECT_EQ(planned(380).frames_in_flight, 4);
  shot_.layers[0].speed = 0;  // all of one instant: its frames are held once
  EXPECT_EQ(planned(200).frames_in_flight, 4);
}

TEST_F(Memory, SaysWhereAViewMayTakeMore) {
  shot_.layers[0].method = "depth";
  EXPECT_THAT(planned(135).note, ::testing::HasSubstr("all 25 cameras needs 61.4 MB"));
  EXPECT_THROW(planned(115), Error);
}

}  // namespace
}  // namespace raystage::compose
