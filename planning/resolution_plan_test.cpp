// SPDX-License-Identifier: Apache-2.0
#include "planning/resolution_plan.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <numbers>

#include "base/error.h"

namespace raystage::planning {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

/// The example of thesis 5.3.5: cameras of 640 pixels and 60 degrees.
rig::Rig example(double spacing = 0.05, int columns = 4) {
  rig::Rig rig;
  for (int column = 0; column < columns; ++column) {
    schemas::CameraGeometry geometry;
    geometry.id = "c" + std::to_string(column);
    geometry.width = 640;
    geometry.height = 480;
    const double focal = 320 / std::tan(std::numbers::pi / 6);
    geometry.intrinsics = {focal, focal, 320, 240, {}};
    rig::Pose pose;
    pose.position.x() = spacing * column;
    rig.cameras.push_back({geometry.id, rig::CameraModel(geometry), pose, {}, {}, {}});
  }
  return rig;
}

TEST(ResolutionPlan, HasTheValuesOfTheThesis) {
  const ResolutionPlan plan = plan_resolution("example", example(), {});
  ASSERT_EQ(plan.rows.size(), 7U);
  EXPECT_EQ(std::lround(plan.rows.front().resolution.never_oversampled), 459);
  EXPECT_EQ(std::lround(plan.rows.back().resolution.never_oversampled), 399);
  EXPECT_EQ(std::lround(plan.rows.back().resolution.never_undersampled), 622);
  const std::string text = format_resolution_plan(plan);
  EXPECT_THAT(text, HasSubstr("4 cameras, 640 pixels and 60.0 deg along the horizontal axis"));
  EXPECT_THAT(
      text, HasSubstr("  0.0 deg                459                 459                 0.0 %\n"));
  EXPECT_THAT(
      text, HasSubstr(" 15.0 deg                399                 622                17.7 %\n"));
  EXPECT_THAT(text, HasSubstr("need cameras of 75 deg; these have 60.0 deg"));
  EXPECT_THAT(text, Not(HasSubstr("skewed")));
  EXPECT_THAT(text, HasSubstr("Up to 27.71 m in front of the array and 27.71 m behind it"));
}

TEST(ResolutionPlan, AsJsonNamesFilesThatAreNotUtf8) {
  const ResolutionPlan plan = plan_resolution("a\xFF/rig.json", example(), {});
  EXPECT_THAT(resolution_plan_as_json(plan), HasSubstr("a\xEF\xBF\xBD/rig.json"));
}

TEST(ResolutionPlan, AsJsonHoldsTheSameNumbers) {
  const ResolutionPlan plan = plan_resolution("example", example(), {});
  const auto json = nlohmann::json::parse(resolution_plan_as_json(plan));
  EXPECT_EQ(json.at("rotations").size(), 7U);
  EXPECT_NEAR(json.at("rotations")[6].at("unrecorded_share"), 0.177, 5e-4);
  EXPECT_TRUE(json.at("fixed_focal_distance_m").is_null());
  EXPECT_NEAR(json.at("pixel_limited_in_front_m"), 27.71, 5e-3);
}

TEST(ResolutionPlan, APageShowsItAndEscapesNames) {
  ResolutionOptions options;
  options.max_rotation_deg = 0;
  const std::string page = resolution_plan_as_page(plan_resolution("<script>", example(), options));
  EXPECT_THAT(page, HasSubstr("&lt;script&gt;"));
  EXPECT_THAT(page, HasSubstr("<svg"));
  EXPECT_THAT(page, HasSubstr("<td>459</td>"));
  EXPECT_THAT(page, Not(HasSubstr("nan")));
}

TEST(ResolutionPlan, OfOneCameraHasNoSpacing) {
  const ResolutionPlan plan = plan_resolution("one", example(0.05, 1), {});
  EXPECT_THAT(format_resolution_plan(plan), HasSubstr("The array has one position."));
  EXPECT_THAT(resolution_plan_as_json(plan), Not(HasSubstr("nan")));
}

TEST(ResolutionPlan, ViewsThatNoFormulaHoldsForAreRefused) {
  for (const ResolutionOptions& options :
       {ResolutionOptions{.view_fov_deg = 0}, ResolutionOptions{.view_fov_deg = 180},
        ResolutionOptions{.max_rotation_deg = 70}, ResolutionOptions{.max_rotation_deg = -1},
        ResolutionOptions{.depth_m = std::numeric_limits<double>::infinity()}}) {
    EXPECT_THROW(plan_resolution("example", example(), options), Error);
  }
  EXPECT_NO_THROW(plan_resolution("e", example(), {.view_fov_deg = 0.01, .max_rotation_deg = 89}));
}

}  // namespace
}  // namespace raystage::planning
