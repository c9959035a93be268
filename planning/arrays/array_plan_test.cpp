// SPDX-License-Identifier: Apache-2.0
#include "planning/arrays/array_plan.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "planning/arrays/array_report.h"
#include "planning/arrays/array_trial.h"
#include "rig/planning/wall_eyed_array.h"
#include "rig/rig.h"

namespace raystage::planning {
namespace {

using ::testing::HasSubstr;

/// The capabilities of the thesis' prototype: 64 cameras of 320 x 240 pixels and 62 degrees, whose
/// views are free of ghosting beyond 7.99 m.
schemas::ArraySpecification prototype() {
  schemas::ArraySpecification wanted;
  wanted.name = "prototype";
  wanted.views = {320, 240, 62, 62, 0, 0, 0};
  for (const double x : {-0.21, 0.21}) {
    for (const double y : {-0.21, 0.21}) wanted.positions.push_back({x, y, 0, {}, {}});
  }
  wanted.depth_range = {7.99, std::numeric_limits<double>::infinity()};
  wanted.fps = 15;
  wanted.minutes = 60;
  schemas::ArraySpecification::Camera camera;
  camera.id = "webcam";
  camera.width_px = 320;
  camera.height_px = 240;
  camera.sensor_width_mm = 3.6;
  camera.focal_lengths_mm = {2, 3.6 / (2 * std::tan(31 * M_PI / 180)), 4};
  camera.price = 100;
  wanted.cameras = {camera};
  wanted.node = {16, 100, 1000};
  wanted.disk = {500, 50, 100};
  return wanted;
}

TEST(ArrayPlan, ReturnsThePrototypeForItsCapabilities) {
  const ArrayPlan plan = plan_array(prototype(), "test");
  const ArrayAlternative& best = plan.alternatives[*plan.best];
  EXPECT_EQ(best.columns, 8);
  EXPECT_EQ(best.rows, 8);
  EXPECT_NEAR(best.spacing.x(), 0.06, 1e-12);
  EXPECT_NEAR(best.horizontal_fov * 180 / M_PI, 62, 1e-9);
  EXPECT_TRUE(best.is_sufficient);
  EXPECT_TRUE(best.is_on_front);
  EXPECT_NEAR(best.ghosting_px, 1, 1e-3);
  EXPECT_NEAR(best.resolution, 1, 1e-12);
  EXPECT_EQ(best.nodes, 4);
  EXPECT_NEAR(best.megapixels_per_s, 64 * 320 * 240 * 15e-6, 1e-9);
  EXPECT_EQ(best.price, 64 * 100 + 4 * 1000 + 4 * 100);
  const auto array =
      rig::find_wall_eyed_array(rig::rig_from_document(rig_of_alternative(plan, best)));
  ASSERT_TRUE(array);
  EXPECT_NEAR(array->size().x(), 0.42, 1e-12);
}

TEST(ArrayPlan, SaysWhyACameraCannotBeUsed) {
  schemas::ArraySpecification wanted = prototype();
  wanted.cameras.push_back(wanted.cameras[0]);
  wanted.cameras[1].id = "slow";
  wanted.cameras[1].max_fps = 10;
  wanted.cameras.push_back(wanted.cameras[0]);
  wanted.cameras[2].id = "narrow";
  wanted.cameras[2].focal_lengths_mm = {4};
  const ArrayPlan plan = plan_array(wanted, "test");
  ASSERT_EQ(plan.unusable.size(), 2U);
  EXPECT_THAT(plan.unusable[0].because, HasSubstr("10 frames a second"));
  EXPECT_THAT(plan.unusable[1].because, HasSubstr("48.5 x 37.3 deg at most, 62.0 x 48.5 deg"));
  wanted.cameras.erase(wanted.cameras.begin());
  EXPECT_THROW(plan_array(wanted, "test"), Error);
  wanted = prototype();
  wanted.views.max_yaw_deg = 70;
  EXPECT_THROW(plan_array(wanted, "test"), Error);
}

TEST(ArrayPlan, BodiesLimitTheSpacing) {
  schemas::ArraySpecification wanted = prototype();
  wanted.cameras[0].body_mm = 100;
  const ArrayPlan plan = plan_array(wanted, "test");
  const ArrayAlternative& best = plan.alternatives[*plan.best];
  EXPECT_EQ(best.columns, 5);
  EXPECT_TRUE(best.is_limited_by_bodies);
  EXPECT_FALSE(best.is_sufficient);
  EXPECT_NEAR(best.ghosting_px, 0.42 / 4 / 0.06, 2e-3);
  EXPECT_THAT(format_array_plan(plan, {}), HasSubstr("bodies are too wide"));
}

TEST(ArrayPlan, RotatedCamerasNeedASmallerFieldOfView) {
  schemas::ArraySpecification wanted = prototype();
  wanted.subject = {8, 0.5};
  wanted.cameras[0].focal_lengths_mm = {20};
  const ArrayPlan plan = plan_array(wanted, "test");
  const ArrayAlternative& best = plan.alternatives[*plan.best];
  EXPECT_TRUE(best.is_rotated);
  const rig::Rig rig = rig::rig_from_document(rig_of_alternative(plan, best));
  for (const rig::Rig::Camera& camera : rig.cameras) {
    const Eigen::Vector3d to_subject =
        (Eigen::Vector3d(0, 0, -8) - camera.pose.position).normalized();
    EXPECT_NEAR(camera.pose.viewing_direction().dot(to_subject), 1, 1e-12);
    EXPECT_NEAR(camera.pose.world_from_camera_rotation.determinant(), 1, 1e-12);
  }
}

// Thesis 6.2: an array on each side of a cube around the positions.
TEST(ArrayPlan, SixSidesSurroundThePositions) {
  schemas::ArraySpecification wanted = prototype();
  wanted.views = {240, 240, 90, 90, 0, 0, 0};
  wanted.cameras[0].height_px = 320;
  wanted.cameras[0].focal_lengths_mm = {1.8};
  wanted.positions.clear();
  for (const double x : {-0.1, 0.1}) {
    for (const double y : {-0.1, 0.1}) {
      wanted.positions.push_back({x, y, 0, {}, {}});
      wanted.positions.push_back({x, y, -0.2, {}, {}});
    }
  }
  const ArrayPlan one = plan_array(wanted, "test");
  wanted.sides = 6;
  const ArrayPlan plan = plan_array(wanted, "test");
  const ArrayAlternative &single = one.alternatives[*one.best],
                         &best = plan.alternatives[*plan.best];
  EXPECT_EQ(best.columns, single.columns);
  EXPECT_EQ(best.cameras(), 6 * single.cameras());
  EXPECT_NEAR(best.megapixels_per_s, 6 * single.megapixels_per_s, 1e-9);
  EXPECT_NEAR(plan.trade[0].width_px, one.trade[0].width_px, 1e-9);
  EXPECT_THAT(format_array_plan(plan, {}), HasSubstr("6 sides of "));
  const schemas::RigDocument document = rig_of_alternative(plan, best);
  const rig::Rig rig = rig::rig_from_document(document);
  ASSERT_EQ(static_cast<int>(rig.cameras.size()), best.cameras());
  EXPECT_LT((rig.centre() - Eigen::Vector3d(0, 0, 0.1)).norm(), 1e-12);
  for (const rig::Rig::Camera& camera : rig.cameras) {
    // It looks outwards, from the plane of its side.
    EXPECT_NEAR((camera.pose.position - rig.centre()).dot(camera.pose.viewing_direction()), 0.1,
                1e-12);
  }
}

TEST(ArrayPlan, SixSidesNeedACubeAndRightAngles) {
  schemas::ArraySpecification wanted = prototype();
  wanted.cameras[0].height_px = 320;
  wanted.cameras[0].focal_lengths_mm = {1.8};
  wanted.views = {240, 240, 90, 90, 0, 0, 0};
  wanted.sides = 6;
  EXPECT_THROW(plan_array(wanted, "test"), Error) << "the positions are in a plane";
  wanted.positions = {{-0.1, -0.1, 0, {}, {}}, {0.1, 0.1, -0.2, {}, {}}};
  EXPECT_NO_THROW(plan_array(wanted, "test"));
  schemas::ArraySpecification narrow = wanted;
  narrow.views.least_fov_deg = narrow.views.largest_fov_deg = 80;
  EXPECT_THROW(plan_array(narrow, "test"), Error);
  schemas::ArraySpecification inwards = wanted;
  inwards.subject = {8, 0.5};
  EXPECT_THROW(plan_array(inwards, "test"), Error);
}

// Thesis 8.2: at one total rate more cameras have less ghosting, and less resolution.
TEST(ArrayPlan, TradesCamerasForResolution) {
  const ArrayPlan plan = plan_array(prototype(), "test");
  ASSERT_GE(plan.trade.size(), 5U);
  for (std::size_t i = 0; i < plan.trade.size(); ++i) {
    const RateTrade& one = plan.trade[i];
    EXPECT_NEAR(one.columns * one.rows * one.width_px * one.height_px * 15e-6,
                plan.trade_megapixels_per_s, 1e-9);
    if (i == 0) continue;
    EXPECT_LT(one.ghosting_px, plan.trade[i - 1].ghosting_px);
    EXPECT_LE(one.resolution, plan.trade[i - 1].resolution);
  }
}

TEST(ArrayPlan, HoldsAtTheExtremes) {
  schemas::ArraySpecification wanted = prototype();
  wanted.depth_range = {3, 3};  // flat
  EXPECT_EQ(plan_array(wanted, "test").alternatives[0].columns, 2);
  EXPECT_EQ(plan_array(wanted, "test").alternatives[0].ghosting_px, 0);
  wanted = prototype();
  wanted.positions = {{0, 0, 0, {}, {}}};  // one position on the plane of the array
  EXPECT_EQ(plan_array(wanted, "test").alternatives[0].cameras(), 1);
  wanted = prototype();
  for (auto& position : wanted.positions) position.depth_m = -1e6;
  EXPECT_THROW(plan_array(wanted, "test"), Error);  // more cameras than can be counted
  wanted = prototype();
  wanted.disk = {500, 1e-302, 0};  // infinitely many disks for nothing
  for (const ArrayAlternative& one : plan_array(wanted, "test").alternatives) {
    EXPECT_TRUE(std::isfinite(one.price));
    EXPECT_EQ(one.disks, 1'000'000'000);
  }
}

TEST(ArrayPlan, ACameraStaysOnOneNode) {
  schemas::ArraySpecification wanted = prototype();
  const double rate = 320 * 240 * 15e-6 * 2 / 8;  // MB/s of a camera
  wanted.node = {16, 1.67 * rate, 1000};          // two cameras do not fit
  EXPECT_EQ(plan_array(wanted, "test").alternatives[0].cameras(),
            plan_array(wanted, "test").alternatives[0].nodes);
  wanted.node.megabytes_per_s = 0.9 * rate;
  EXPECT_THROW(plan_array(wanted, "test"), Error);
}

TEST(ArrayPlan, AMissingPixelIsReported) {
  schemas::ArraySpecification wanted = prototype();
  wanted.views.width_px = 321;
  const ArrayPlan plan = plan_array(wanted, "test");
  EXPECT_FALSE(plan.alternatives[*plan.best].is_sufficient);
  EXPECT_THAT(format_array_plan(plan, {}), HasSubstr("320 distinct pixels of the 321"));
}

TEST(ArrayPlan, ReportsOfManyCamerasAndHostileNamesAreBounded) {
  schemas::ArraySpecification wanted = prototype();
  wanted.name = "<b>name";
  wanted.positions = {{-100, 0, 0, {}, {}}, {100, 0, 0, {}, {}}};  // one row of 3333
  const ArrayPlan plan = plan_array(wanted, "test");
  EXPECT_EQ(plan.alternatives[*plan.best].rows, 1);
  EXPECT_GT(plan.alternatives[*plan.best].columns, 3000);
  const std::string page = array_plan_as_page(plan, {});
  EXPECT_LT(page.size(), 300'000U);
  EXPECT_EQ(page.find("<b>name"), std::string::npos);
  const auto json = nlohmann::json::parse(array_plan_as_json(plan, {}));
  EXPECT_EQ(json["alternatives"].size(), plan.alternatives.size());
  EXPECT_EQ(json["alternatives"][json["best"].get<std::size_t>()]["sufficient"], true);
}

// The simulated array has the same ghosting as the planned one, and its error is as predicted.
TEST(ArrayTrials, MeasureWhatIsPredicted) {
  schemas::ArraySpecification wanted = prototype();
  wanted.depth_range.near = 3;
  wanted.largest_error_px = 3;
  const ArrayPlan plan = plan_array(wanted, "test");
  const std::vector<ArrayTrial> trials = try_arrays(plan, {*plan.best}, "test");
  ASSERT_EQ(trials.size(), 1U);
  const ArrayAlternative& best = plan.alternatives[*plan.best];
  EXPECT_NEAR(trials[0].ghosting_px / best.ghosting_px, 1, 0.1);
  EXPECT_NEAR(trials[0].focal_plane_db, trials[0].predicted_db, 1);
  EXPECT_GT(trials[0].depth_db, trials[0].focal_plane_db + 1);
  wanted.depth_range = {3, 3};
  EXPECT_TRUE(try_arrays(plan_array(wanted, "test"), {0}, "test").empty());
}

}  // namespace
}  // namespace raystage::planning
