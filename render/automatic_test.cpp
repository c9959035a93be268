// SPDX-License-Identifier: Apache-2.0
#include "render/automatic/automatic.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "render/automatic/left_out_camera.h"
#include "render/methods.h"
#include "render/planar/focal_plane.h"
#include "render/renderer.h"
#include "render/view/synthetic_take.h"

namespace raystage {
namespace {

using ::testing::HasSubstr;
using ::testing::StartsWith;

/// A take of a painted plane 4 m away, on a grid of 4 x 4, and what a method is asked for.
class Automatic : public ::testing::Test {
 protected:
  void write(double spacing, std::optional<DepthRange> range) {
    testing::SyntheticTake settings;
    settings.cameras = testing::camera_grid(4, 4, spacing, 96, 64);
    settings.depth_range = range;
    settings.knows_depth_range = range.has_value();
    testing::write_synthetic_take(settings, folder_.path() / "take");
    take_ = std::make_unique<Take>(folder_.path() / "take");
    cache_ = std::make_unique<FrameCache>(*take_, 1 << 28, BlendSpace::kPerceptual);
    instant_.take = take_.get();
    instant_.rig = &take_->rig();
    instant_.cache = cache_.get();
    instant_.frame_of_camera.assign(16, 0);
    std::vector<int> all;
    for (int i = 0; i < 16; ++i) all.push_back(i);
    instant_.members = all;
    instant_.present = std::make_shared<const Topology>(topology_of(take_->rig(), all));
    instant_.complete = instant_.present;
  }

  ViewRequest request(double plane_depth = 4) {
    return {view_, instant_, {0, 0, 1, plane_depth}, none_, kept_, 1 << 28, false};
  }

  /// Alike but for what they cost: enough to see which is taken.
  std::vector<Candidate> ladder() const {
    Candidate quick{.label = "quick", .method = focal_plane_method(), .pixel_ns = 10};
    Candidate slow = quick;
    slow.label = "slow";
    slow.method = nearest_method();
    slow.pixel_ns = 1000;
    Candidate best = quick;
    best.label = "best";
    best.pixel_ns = 1e6;
    best.instant_ns = 1.6e4;  // 16 cameras of 96 x 64: 0.8 s on two threads
    return {quick, slow, best};
  }

  TestFolder folder_;
  std::unique_ptr<Take> take_;
  std::unique_ptr<FrameCache> cache_;
  Instant instant_;
  KeptResults kept_{1 << 28};
  MethodOptions none_;
  VirtualCamera view_ = virtual_camera_with_fov(1000, 1000, 0.6, {});
};

TEST_F(Automatic, ASinglePlaneIsUsedWhereItIsFreeOfGhosts) {
  write(0.02, DepthRange{3, 5});
  // f = 80 px: 80 * 0.02 * (1/3 - 1/5) = 0.21 px.
  const Choice choice = choose(ladder(), {.psnr_db = 90}, request());
  EXPECT_EQ(choice.candidate, 0U);
  EXPECT_THAT(choice.why, HasSubstr("20 mm apart"));
  EXPECT_THAT(choice.why, HasSubstr("eq. 2.1"));
}

TEST_F(Automatic, WithoutATargetTheMostAccurateIsTaken) {
  write(0.2, DepthRange{1, 5});  // 12.8 px
  const Choice choice = choose(ladder(), {}, request());
  EXPECT_EQ(choice.candidate, 2U);
  EXPECT_THAT(choice.why, StartsWith("best: the most accurate"));
}

TEST_F(Automatic, TheMostAccurateWithinTheTimeIsTaken) {
  write(0.2, DepthRange{1, 5});
  // A megapixel on two threads: 5 ms, 0.5 s, 501 s.
  EXPECT_EQ(choose(ladder(), {.seconds_per_frame = 600}, request()).candidate, 2U);
  EXPECT_EQ(choose(ladder(), {.seconds_per_frame = 500}, request()).candidate, 1U);
  EXPECT_EQ(choose(ladder(), {.seconds_per_frame = 0.4}, request()).candidate, 0U);
  const Choice none = choose(ladder(), {.seconds_per_frame = 0.001}, request());
  EXPECT_EQ(none.candidate, 0U);
  EXPECT_THAT(none.why, HasSubstr("nothing takes less"));
}

TEST_F(Automatic, TheCheapestThatMeetsTheErrorIsTaken) {
  write(0.2, DepthRange{2.5, 10});  // best at 4 m
  // The plane is where the painting is, so focal_plane is good and nearest as good.
  const double good = error_at_left_out_cameras(focal_plane_method(), {}, request());
  EXPECT_GT(good, 30);
  const Choice cheap = choose(ladder(), {.psnr_db = good - 1}, request());
  EXPECT_EQ(cheap.candidate, 0U);
  EXPECT_THAT(cheap.why, HasSubstr("dB at cameras left out"));
  EXPECT_EQ(choose(ladder(), {.psnr_db = 99}, request()).candidate, 2U);
}

TEST_F(Automatic, AWrongPlaneIsMeasuredAsSuch) {
  write(0.2, DepthRange{1, 5});
  const double right = error_at_left_out_cameras(focal_plane_method(), {}, request(4));
  const double wrong = error_at_left_out_cameras(focal_plane_method(), {}, request(2));
  EXPECT_GT(right, wrong + 10);
}

TEST_F(Automatic, WithoutADepthRangeThereIsOnlyThePlane) {
  write(0.2, std::nullopt);
  const Choice choice = choose(ladder(), {.psnr_db = 99}, request());
  EXPECT_EQ(choice.candidate, 0U);
  EXPECT_THAT(choice.why, HasSubstr("no depth range"));
}

TEST_F(Automatic, GivesWhatTheChosenMethodGivesAndSaysWhich) {
  write(0.02, DepthRange{3, 5});
  const FrameSelection frames = select_frames(*take_, 0, 1);
  const VirtualCamera view = virtual_camera_with_fov(40, 30, 0.6, {});
  const LightFieldRenderer renderer(*take_, {});
  // Free of ghosts on the plane of eq. 2.2 (3.75 m), whatever plane is asked for.
  const RenderedView chosen = renderer.render(view, frames, {"auto", {0, 0, 1, 1}});
  const RenderedView plane = renderer.render(view, frames, {"focal_plane", {0, 0, 1, 3.75}});
  EXPECT_EQ(chosen.rgba, plane.rgba);
  ASSERT_EQ(chosen.notes.size(), 1U);
  EXPECT_THAT(chosen.notes[0], StartsWith("auto: focal_plane: cameras 20 mm apart"));
  EXPECT_THAT(chosen.notes[0], HasSubstr("3.75 m off"));
}

TEST_F(Automatic, ChoosesAlikeHoweverFinelyAViewIsSampled) {
  write(0.2, DepthRange{1, 5});
  const ViewRequest coarse = request();
  VirtualCamera larger = coarse.view;
  larger.width *= 4;
  larger.height *= 4;
  const ViewRequest sampled{larger,
                            coarse.instant,
                            coarse.focal_plane,
                            coarse.options,
                            coarse.kept,
                            coarse.working_bytes,
                            false,
                            false,
                            true,
                            4};
  for (const double seconds : {0.4, 500.0, 600.0}) {
    const Target target{.seconds_per_frame = seconds};
    EXPECT_EQ(choose(ladder(), target, sampled).candidate,
              choose(ladder(), target, coarse).candidate);
  }
}

}  // namespace
}  // namespace raystage
