// SPDX-License-Identifier: Apache-2.0
#include "planning/shot_check.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>
#include <numeric>
#include <string>
#include <vector>

#include "base/error.h"
#include "planning/nearest_path.h"
#include "planning/shot_check_report.h"
#include "schemas/rig_document.h"
#include "testing/compose/sequence_test_data.h"
#include "testing/test_folder.h"

namespace raystage::planning {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

class ShotCheckTest : public ::testing::Test {
 protected:
  ShotCheckTest() {
    testing::write_wall_take(folder_.path() / "take");
    shot_ = testing::wall_shot();
    shot_.camera.keys = {testing::camera_key(101, {0.05, -0.05, 0}, 40),
                         testing::camera_key(106, {0.25, -0.05, 0}, 40)};
  }

  ShotCheck check() const {
    const compose::ShotPlan plan(shot_, folder_.path() / "shot.json", {});
    std::vector<int> numbers(static_cast<std::size_t>(shot_.last_frame - shot_.first_frame + 1));
    std::iota(numbers.begin(), numbers.end(), shot_.first_frame);
    return check_shot(plan, "shot.json", plan.plan(numbers, compose::MissingFrames::kHold));
  }

  testing::TestFolder folder_;
  schemas::ShotDocument shot_;
};

TEST_F(ShotCheckTest, FollowsTheCameraOutOfTheArray) {
  const ShotCheck check = this->check();
  ASSERT_EQ(check.layers.size(), 1U);
  const LayerCheck& layer = check.layers[0];
  EXPECT_EQ(layer.cameras, 4);
  EXPECT_NEAR(layer.spacing, 0.1, 1e-12);
  ASSERT_EQ(layer.frames.size(), 6U);
  EXPECT_EQ(layer.frames.front().unrecorded_share, 0);
  EXPECT_GT(layer.frames.front().boundary_distance.value(), 0);
  EXPECT_LT(layer.frames.back().boundary_distance.value(), -0.1);
  EXPECT_EQ(layer.frames.back().unrecorded_share, 1) << "all rays miss the array";
  for (std::size_t i = 1; i < layer.frames.size(); ++i) {
    const FrameCheck &before = layer.frames[i - 1], &frame = layer.frames[i];
    EXPECT_LT(frame.boundary_distance.value(), before.boundary_distance.value());
    EXPECT_GE(frame.unrecorded_share, before.unrecorded_share);
    // In the plane of the array every ray passes where the camera is.
    EXPECT_EQ(frame.unrecorded_share > 0, frame.boundary_distance.value() < -1e-9) << frame.frame;
  }
  EXPECT_FALSE(layer.field_of_view_factor) << "the camera stands beside the array";
  EXPECT_EQ(check.worst_unrecorded_share(), 1);
}

// The camera leaves the array while the shutter is open: as many rays are missing as in the mean of
// sharp frames in between.
TEST_F(ShotCheckTest, OfABlurredFrameIsTheMeanOverTheExposure) {
  const auto key_at = [](int frame, double time) {
    return testing::camera_key(frame, {0.05 + 0.1 * time, -0.05, 0.1}, 40);
  };
  shot_.camera.keys = {key_at(101, 0), key_at(102, 1)};
  shot_.last_frame = 102;
  shot_.width *= 20;  // the finer the picture, the more times
  shot_.height *= 20;
  shot_.output.motion_samples = 257;
  const double sharp = check().layers[0].frames[0].unrecorded_share;
  for (auto& key : shot_.camera.keys) key.shutter_deg = 360;
  const double blurred = check().layers[0].frames[0].unrecorded_share;
  for (auto& key : shot_.camera.keys) key.shutter_deg.reset();
  double mean = 0;
  constexpr int kTimes = 200;
  for (int i = 0; i < kTimes; ++i) {
    const double time = std::clamp((i + 0.5) / kTimes - 0.5, 0.0, 1.0);  // at rest before the key
    shot_.camera.keys = {key_at(101, time)};
    shot_.last_frame = 101;
    mean += check().layers[0].frames[0].unrecorded_share / kTimes;
  }
  EXPECT_EQ(sharp, 0);
  EXPECT_GT(mean, 0.02);
  EXPECT_NEAR(blurred, mean, 0.01);
}

TEST_F(ShotCheckTest, CamerasThatAreAbsentRecordNothing) {
  shot_.camera.keys = {testing::camera_key(101, {0.08, -0.08, 0}, 40)};
  const ShotCheck check = this->check();
  const auto& frames = check.layers[0].frames;
  for (const FrameCheck& frame : frames) {
    // The last camera has no frame at the third instant.
    EXPECT_EQ(frame.unrecorded_share, frame.frame == 103 ? 1 : 0) << frame.frame;
    EXPECT_EQ(frame.cameras, frame.frame == 103 ? 3 : 4);
    EXPECT_EQ(frame.unrecorded_share_of_all, 0);
  }
  EXPECT_THAT(format_shot_check(check),
              HasSubstr("With all cameras none of those of frame 103 would be missing."));
  // Any camera that sees a point shows it: the other ones stand in.
  shot_.layers[0].method = "plane_sweep";
  EXPECT_EQ(this->check().worst_unrecorded_share(), 0);
  EXPECT_THAT(format_shot_check(check),
              HasSubstr("Up to 1 of 4 cameras are absent in 1 of 6 frames: 103."));
}

TEST_F(ShotCheckTest, NamesCannotLookLikeLinesOfAReport) {
  shot_.layers[0].name = "people\nEvery ray was recorded";
  EXPECT_THAT(format_shot_check(check()),
              HasSubstr("\npeople\\u000aEvery ray was recorded: method"));
}

TEST_F(ShotCheckTest, SuggestsTheFieldOfViewThatWasRecorded) {
  shot_.camera.keys = {testing::camera_key(101, {0.03, -0.03, 0.1}, 60)};
  ShotCheck check = this->check();
  ASSERT_GT(check.worst_unrecorded_share(), 0.01);
  ASSERT_TRUE(check.layers[0].field_of_view_factor);
  const double factor = *check.layers[0].field_of_view_factor;
  ASSERT_LT(factor, 1);
  const auto fov = [&](double narrower) {
    return 360 / std::numbers::pi * std::atan(narrower * std::tan(30 * std::numbers::pi / 180));
  };
  shot_.camera.keys[0].horizontal_fov_deg = fov(factor);
  EXPECT_EQ(this->check().worst_unrecorded_share(), 0);
  shot_.camera.keys[0].horizontal_fov_deg = fov(factor * 1.01);
  EXPECT_GT(this->check().worst_unrecorded_share(), 0);
  const std::string text = format_shot_check(check);
  EXPECT_THAT(text, HasSubstr(fmt::format("with {:.3f} times the field of view", factor)));
}

// More frames than are checked together: each as by itself, and one field of view for all.
TEST_F(ShotCheckTest, OfManyFramesIsAsOfEach) {
  shot_.last_frame = 700;
  shot_.camera.keys = {testing::camera_key(101, {0.03, -0.03, 0.1}, 40),
                       testing::camera_key(700, {0.035, -0.03, 0.1}, 60)};
  const LayerCheck all = check().layers[0];
  ASSERT_EQ(all.frames.size(), 600U);
  ASSERT_GT(all.frames.back().unrecorded_share, 0);
  double least = 1;
  for (const int frame : {101, 356, 357, 612, 613, 700}) {
    shot_.first_frame = shot_.last_frame = frame;
    const LayerCheck one = check().layers[0];
    const FrameCheck& of_all = all.frames[static_cast<std::size_t>(frame - 101)];
    EXPECT_EQ(of_all.frame, frame);
    EXPECT_EQ(of_all.unrecorded_share, one.frames[0].unrecorded_share);
    EXPECT_EQ(of_all.boundary_distance, one.frames[0].boundary_distance);
    least = std::min(least, one.field_of_view_factor.value());
  }
  EXPECT_NEAR(all.field_of_view_factor.value(), least, 2e-3);
}

// The path leaves the array to the right; the nearest one stays at its border, and begins to turn
// away before.
TEST_F(ShotCheckTest, TheNearestPathLacksNoRays) {
  shot_.camera.keys = {testing::camera_key(101, {0.05, -0.05, 0.02}, 40),
                       testing::camera_key(106, {0.15, -0.05, 0.02}, 40)};
  ASSERT_GT(check().worst_unrecorded_share(), 0.5);
  const compose::ShotPlan plan(shot_, folder_.path() / "shot.json", {});
  const NearestPath path = find_nearest_path(plan, "shot.json");
  EXPECT_GT(path.largest_shift, 0.05);
  EXPECT_LT(path.largest_shift, 0.08);
  EXPECT_EQ(path.largest_shift_frame, 106);
  ASSERT_EQ(path.shot.camera.keys.size(), 6U);
  EXPECT_NEAR(path.shot.camera.keys[0].position.value()[0], 0.05, 0.02) << "far from the border";
  double before = 0.03;
  for (const auto& key : path.shot.camera.keys) {
    EXPECT_GE(key.position.value()[0], before - 1e-12) << "never back";
    before = key.position.value()[0];
  }
  shot_ = path.shot;
  const ShotCheck moved = check();
  for (const FrameCheck& frame : moved.layers[0].frames) {
    if (frame.frame == 103) continue;  // a camera is absent
    EXPECT_LT(frame.unrecorded_share, 1e-6) << frame.frame;
    EXPECT_GT(frame.boundary_distance.value(), -1e-9) << frame.frame;
  }
}

// Takes that are hidden, and the far side of a volume, do not move the camera.
TEST_F(ShotCheckTest, OnlyVisibleTakesLimitThePath) {
  schemas::ShotDocument::Layer behind = shot_.layers[0];
  shot_.camera.keys = {testing::camera_key(101, {0.05, -0.05, 0}, 40)};
  shot_.layers[0].volume = behind.volume = "v";
  testing::write_wall_take(folder_.path() / "behind");
  auto rig = schemas::read_rig(folder_.path() / "behind" / "rig.json");
  for (auto& camera : rig.cameras) camera.geometry.world_from_camera[3] += 5;
  schemas::write_rig(rig, folder_.path() / "behind" / "rig.json");
  behind.take = "behind";
  shot_.layers.push_back(behind);
  const auto shift = [&] {
    const compose::ShotPlan plan(shot_, folder_.path() / "shot.json", {});
    return find_nearest_path(plan, "shot.json").largest_shift;
  };
  EXPECT_EQ(shift(), 0);
  shot_.last_frame = 102;
  EXPECT_EQ(check().worst_unrecorded_share(), 0) << "the nearer take counts";
  EXPECT_GT(check().worst_resolution(), 0.9);
  shot_.layers[0].volume = shot_.layers[1].volume = "";
  EXPECT_EQ(check().worst_unrecorded_share(), 1);
  {
    const compose::ShotPlan plan(shot_, folder_.path() / "shot.json", {});
    EXPECT_THROW(find_nearest_path(plan, "shot.json"), Error) << "it cannot be before both";
  }
  shot_.layers[1].first_frame = 200;  // never visible
  EXPECT_EQ(shift(), 0);
}

TEST_F(ShotCheckTest, TimesOutsideOfTheTakeHaveNoRays) {
  shot_.camera.keys = {testing::camera_key(101, {0.03, -0.03, 0}, 40)};
  shot_.last_frame = 200;
  const compose::ShotPlan plan(shot_, folder_.path() / "shot.json", {});
  const std::vector<int> numbers{101, 200};
  const ShotCheck check =
      check_shot(plan, "shot.json", plan.plan(numbers, compose::MissingFrames::kBlack));
  ASSERT_EQ(check.layers[0].frames.size(), 2U);
  EXPECT_EQ(check.layers[0].frames[0].unrecorded_share, 0);
  EXPECT_EQ(check.layers[0].frames[1].unrecorded_share, 1);
  EXPECT_FALSE(check.layers[0].frames[1].resolution);
  EXPECT_GT(check.worst_resolution(), 0.5) << "of the frames that show something";
  EXPECT_FALSE(check.layers[0].field_of_view_factor);
  shot_.layers[0].last_frame = 150;
  const compose::ShotPlan hidden(shot_, folder_.path() / "shot.json", {});
  const ShotCheck nothing = check_shot(
      hidden, "shot.json", hidden.plan(std::vector{200}, compose::MissingFrames::kBlack));
  EXPECT_FALSE(nothing.has_frames());
  EXPECT_EQ(shot_check_verdict(nothing), "no light field is visible in these frames");
}

TEST_F(ShotCheckTest, NoPathHasAViewThatLooksAway) {
  shot_.camera.keys[0].orientation = std::array<double, 4>{0, 0, 1, 0};
  const compose::ShotPlan plan(shot_, folder_.path() / "shot.json", {});
  EXPECT_THROW(find_nearest_path(plan, "shot.json"), Error);
}

TEST_F(ShotCheckTest, ReportsHoldTheSameNumbers) {
  const ShotCheck check = this->check();
  const std::string text = format_shot_check(check);
  EXPECT_THAT(text, HasSubstr("6 frames (101-106), 40x30 pixels"));
  EXPECT_THAT(text, HasSubstr("outside of its range of motion at frame 106"));
  EXPECT_THAT(text, HasSubstr("4 cameras up to 100.0 mm apart"));
  EXPECT_THAT(text, Not(HasSubstr("at their own depths")));
  shot_.layers[0].method = "plane_sweep";
  EXPECT_THAT(format_shot_check(this->check()),
              HasSubstr("method plane_sweep shows things at their own depths"));
  const auto json = nlohmann::json::parse(shot_check_as_json(check));
  EXPECT_EQ(json.at("schema"), "raystage/shot_check/1");
  EXPECT_EQ(json.at("unrecorded_share"), 1);
  const auto& frames = json.at("layers")[0].at("frames");
  ASSERT_EQ(frames.size(), 6U);
  EXPECT_EQ(frames[5].at("frame"), 106);
  EXPECT_TRUE(json.at("layers")[0].at("field_of_view_factor").is_null());
  const std::string page = shot_check_as_page(check);
  EXPECT_THAT(page, HasSubstr("Rays that no camera recorded"));
  EXPECT_THAT(page, HasSubstr("<svg"));
}

TEST_F(ShotCheckTest, NamesInDocumentsAreNoMarkup) {
  shot_.layers[0].name = "<script>alert(1)</script>";
  EXPECT_THAT(shot_check_as_page(check()), Not(HasSubstr("<script>alert")));
}

/// Returns four fisheyes of 149 degrees that look outwards from the corners of a tetrahedron.
schemas::RigDocument outward_fisheyes() {
  schemas::RigDocument rig;
  rig.name = "four";
  const std::array<Eigen::Vector3d, 4> corners{{{1, 1, 1}, {1, -1, -1}, {-1, 1, -1}, {-1, -1, 1}}};
  for (const Eigen::Vector3d& corner : corners) {
    const Eigen::Vector3d back = -corner.normalized();
    const Eigen::Vector3d right = Eigen::Vector3d::UnitY().cross(back).normalized();
    const Eigen::Vector3d up = back.cross(right);
    schemas::RigDocument::Camera camera;
    schemas::CameraGeometry& g = camera.geometry;
    g.id = fmt::format("c{}", rig.cameras.size());
    g.width = testing::kWidth;
    g.height = testing::kHeight;
    g.intrinsics = {10.9, 10.9, g.width / 2.0, g.height / 2.0, {}};
    g.intrinsics.projection = schemas::Projection::kFtheta;
    g.intrinsics.half_angle = 1.3;
    for (std::size_t row = 0; row < 3; ++row) {
      const auto axis = static_cast<Eigen::Index>(row);
      g.world_from_camera[4 * row] = right[axis];
      g.world_from_camera[4 * row + 1] = up[axis];
      g.world_from_camera[4 * row + 2] = back[axis];
      g.world_from_camera[4 * row + 3] = 0.1 * corner[axis];
    }
    rig.cameras.push_back(camera);
  }
  return rig;
}

TEST_F(ShotCheckTest, ChecksAllDirectionsWithinAnArrayThatLooksOutwards) {
  schemas::write_rig(outward_fisheyes(), folder_.path() / "take/rig.json");
  shot_.camera.projection = schemas::ShotDocument::Camera::Projection::kEquirectangular;
  shot_.width = 60;
  shot_.camera.keys = {testing::camera_key(101, {0.01, -0.01, 0.02}, 40)};
  const ShotCheck within = check();
  ASSERT_EQ(within.layers.size(), 1U);
  const LayerCheck& layer = within.layers[0];
  EXPECT_TRUE(layer.sees_all_directions);
  EXPECT_EQ(layer.frames.front().unrecorded_share, 0);
  EXPECT_FALSE(layer.frames.front().boundary_distance);
  ASSERT_TRUE(layer.frames.front().resolution);
  // 60 pixels around are 9.5 per radian; the cameras have 10.9.
  EXPECT_EQ(layer.frames.front().resolution, 1);
  // Without a camera, at least the directions within 35 degrees of its own are seen by none.
  EXPECT_EQ(layer.frames[2].cameras, 3);
  EXPECT_GT(layer.frames[2].unrecorded_share, 0.08);
  EXPECT_LT(layer.frames[2].unrecorded_share, 0.3);
  EXPECT_EQ(layer.frames[2].unrecorded_share_of_all, 0);

  shot_.camera.keys = {testing::camera_key(101, {0.5, 0, 0}, 40)};
  const double outside = check().layers[0].frames.front().unrecorded_share;
  EXPECT_LT(outside, 0.01) << "of other cells; every method blends from any camera";
}

TEST_F(ShotCheckTest, RefusesWhatItCannotCheck) {
  shot_.camera.projection = schemas::ShotDocument::Camera::Projection::kEquirectangular;
  EXPECT_THROW(check(), Error);
}

}  // namespace
}  // namespace raystage::planning
