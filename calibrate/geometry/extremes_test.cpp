// SPDX-License-Identifier: Apache-2.0
// Tests difficult arrays: a calibration is either correct or rejected, and never accepted with a
// wrong rig.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "base/error.h"
#include "calibrate/geometry/calibration.h"
#include "testing/calibrate/test_synthetic_array.h"

namespace raystage::calibrate {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;

struct Case {
  const char* name;
  testing::SyntheticArrayOptions simulation;
  bool lens_is_known = false;
  bool is_accepted = true;
};

CalibrationOptions settings_for(const testing::SyntheticArray& truth, bool lens_is_known) {
  CalibrationOptions options;
  options.scale.spacing_m = 0.06;
  options.solve.horizontal_fov = 60 * testing::kTestDegree;
  if (lens_is_known) {
    options.solve.lenses.assign(truth.detections.cameras.size(), truth.lens);
    options.solve.lens_is_known = true;
  }
  return options;
}

std::string reasons_text(const Calibration& calibration) {
  std::string text;
  for (const std::string& s : calibration.verdict.reasons) text += "not sure: " + s + "\n";
  for (const std::string& s : calibration.verdict.next_steps) text += "next: " + s + "\n";
  return text;
}

class CalibrationAtExtremes : public ::testing::TestWithParam<Case> {};

TEST_P(CalibrationAtExtremes, IsRightOrRefused) {
  const Case& c = GetParam();
  const testing::SyntheticArray truth = testing::make_synthetic_array(c.simulation);
  Calibration calibration;
  try {
    calibration = calibrate(truth.detections, settings_for(truth, c.lens_is_known));
  } catch (const Error& refusal) {
    EXPECT_FALSE(c.is_accepted) << refusal.what();
    EXPECT_EQ(refusal.exit_code(), ExitCode::kBadInput);
    return;
  }
  const testing::PoseErrors errors = testing::pose_errors(calibration.model, truth.poses);
  SCOPED_TRACE(fmt::format("{:.2f} mm, {:.3f} degrees, {} placed\n{}", 1000 * errors.metres,
                           errors.degrees, errors.placed, reasons_text(calibration)));
  EXPECT_EQ(calibration.verdict.is_accepted(), c.is_accepted);
  if (calibration.verdict.is_accepted()) {
    EXPECT_EQ(errors.placed, static_cast<int>(truth.poses.size()));
    EXPECT_LE(errors.metres, 0.1 * c.simulation.spacing);
    EXPECT_LE(errors.degrees, 0.3);
    for (const ArrayModel::Camera& camera : calibration.model.cameras) {
      EXPECT_NEAR(camera.intrinsics.fx, truth.lens.fx, 0.03 * truth.lens.fx);
    }
  } else {
    EXPECT_FALSE(calibration.verdict.next_steps.empty());
  }
}

constexpr double kParallel = 0;

INSTANTIATE_TEST_SUITE_P(
    Cases, CalibrationAtExtremes,
    ::testing::Values(
        Case{"thesis_lens_known", {}, true},
        // An array with exactly parallel axes cannot distinguish a longer lens from a deeper scene.
        Case{"parallel",
             {.rows = 4, .columns = 4, .mounting_m = 0, .mounting_deg = kParallel},
             false,
             false},
        Case{"parallel_lens_known", {.mounting_m = 0, .mounting_deg = kParallel}, true},
        Case{"two_cameras", {.rows = 1, .columns = 2, .missing = 0}, false, false},
        Case{"two_cameras_lens_known",
             {.rows = 1, .columns = 2, .points = 200, .noise_px = 0.1, .missing = 0},
             true},
        Case{"line", {.rows = 1, .columns = 8, .points = 200}, true},
        Case{"line_upright", {.rows = 8, .columns = 1, .points = 200}, true},
        Case{"points_on_a_plane",
             {.rows = 3, .columns = 3, .points_on_a_plane = true},
             false,
             false},
        Case{"points_on_a_plane_lens_known",
             {.rows = 3, .columns = 3, .points = 200, .points_on_a_plane = true},
             true},
        Case{"a_kilometre_away",
             {.rows = 3, .columns = 3, .nearest = 1000, .farthest = 2000},
             true,
             false},
        Case{"light_at_rest",
             {.rows = 3, .columns = 3, .points = 10, .outliers = 0, .repetitions = 20},
             true,
             false},
        Case{"one_in_ten_wrong", {.outliers = 0.1}}),
    [](const auto& tested) { return std::string(tested.param.name); });

TEST(CalibrationAtItsLimits, ACameraThatSeesNothingIsNamed) {
  testing::SyntheticArray truth = testing::make_synthetic_array({.rows = 3, .columns = 3});
  std::erase_if(truth.detections.detections, [](const auto& d) { return d.camera == 4; });
  const Calibration calibration = calibrate(truth.detections, settings_for(truth, true));
  EXPECT_THAT(calibration.verdict.reasons, Contains(HasSubstr("Nothing was seen by c04")));
  // The rig can still be made from the rejected calibration: the other cameras are correct.
  EXPECT_LE(testing::pose_errors(calibration.model, truth.poses).metres, 0.004);
  EXPECT_EQ(make_rig_document(calibration, {}, "").cameras.size(), 8U);
}

TEST(CalibrationAtItsLimits, CamerasThatShareNothingAreNamed) {
  testing::SyntheticArray truth =
      testing::make_synthetic_array({.rows = 2, .columns = 4, .points = 200});
  // The left half observes the first 100 points, the right half the others.
  std::erase_if(truth.detections.detections,
                [](const auto& d) { return (d.camera % 4 < 2) != (d.point < 100); });
  const Calibration calibration = calibrate(truth.detections, settings_for(truth, true));
  EXPECT_THAT(calibration.verdict.reasons, Contains(HasSubstr("groups that share no points")));
  EXPECT_EQ(compute_overlap(calibration.model).pairs_without_points().size(), 16U);
}

TEST(CalibrationAtItsLimits, WithoutScaleNothingIsVouchedFor) {
  const testing::SyntheticArray truth = testing::make_synthetic_array({.rows = 3, .columns = 3});
  CalibrationOptions options = settings_for(truth, true);
  options.scale = {};
  EXPECT_THAT(calibrate(truth.detections, options).verdict.reasons, Contains(HasSubstr("scale")));
}

/// In these cases least squares may converge to wrong arrays with a small reprojection error.
TEST(CalibrationAtItsLimits, WhatIsVouchedForIsRight) {
  const std::vector<testing::SyntheticArrayOptions> hard{
      {.rows = 3, .columns = 3, .nearest = 10, .farthest = 20},
      {.rows = 3, .columns = 3, .nearest = 1000, .farthest = 2000},
      {.rows = 1, .columns = 2, .points = 200, .missing = 0, .points_on_a_plane = true},
      {.rows = 2, .columns = 2, .outliers = 0.3}};
  for (testing::SyntheticArrayOptions simulation : hard) {
    for (simulation.seed = 1; simulation.seed <= 8; ++simulation.seed) {
      const testing::SyntheticArray truth = testing::make_synthetic_array(simulation);
      try {
        const Calibration found = calibrate(truth.detections, settings_for(truth, true));
        if (!found.verdict.is_accepted()) continue;
        const testing::PoseErrors errors = testing::pose_errors(found.model, truth.poses);
        EXPECT_LE(errors.metres, 0.1 * simulation.spacing) << simulation.seed;
        EXPECT_LE(errors.degrees, 0.5) << simulation.seed;
      } catch (const Error&) {  // rejected
      }
    }
  }
}

TEST(RestingLights, CountOnce) {
  testing::SyntheticArray truth =
      testing::make_synthetic_array({.rows = 3, .columns = 3, .points = 50, .repetitions = 3});
  const std::size_t all = truth.detections.detections.size();
  EXPECT_EQ(merge_static_points(truth.detections), 100);
  EXPECT_EQ(truth.detections.detections.size(), all / 3);
  EXPECT_EQ(merge_static_points(truth.detections), 0);
}

}  // namespace
}  // namespace raystage::calibrate
