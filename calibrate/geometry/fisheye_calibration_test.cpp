// SPDX-License-Identifier: Apache-2.0
// Calibrates simulated arrays of fisheyes, whose truth is known, from a light and from boards.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "calibrate/geometry/board_array.h"
#include "calibrate/geometry/calibration.h"
#include "rig/fisheye_lens.h"
#include "testing/calibrate/test_fisheyes.h"
#include "testing/calibrate/test_synthetic_array.h"

namespace raystage::calibrate {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;
using schemas::Projection;
using testing::FisheyeCase;

class FisheyeLenses : public ::testing::TestWithParam<FisheyeCase> {};

/// Expects parameters within four of their deviations, which must be small.
void expect_true_lens(const schemas::Intrinsics& found, const LensParameters& deviations,
                      const schemas::Intrinsics& truth) {
  EXPECT_EQ(found.projection, truth.projection);
  const LensParameters values = lens_parameters(found), expected = lens_parameters(truth);
  for (std::size_t k = 0; k < values.size(); ++k) {
    EXPECT_NEAR(values[k], expected[k], 4 * deviations[k] + 1e-12)
        << lens_parameterization(found.projection).parameters()[k].name;
  }
  EXPECT_LE(deviations[0], 0.003 * truth.fx);
}

/// Returns the largest distance between the projections of two lenses, pixels, up to an angle.
double largest_difference_px(const schemas::Intrinsics& a, const schemas::Intrinsics& b,
                             double angle) {
  const rig::CameraModel one({"a", testing::kFisheyeWidth, testing::kFisheyeHeight, a, {}, {}, {}});
  const rig::CameraModel other(
      {"b", testing::kFisheyeWidth, testing::kFisheyeHeight, b, {}, {}, {}});
  double most = 0;
  for (int i = 0; i < 400; ++i) {
    const double to_axis = angle * (i % 20) / 19, around = 0.33 * i;
    const Vector3d ray(std::sin(to_axis) * std::cos(around), std::sin(to_axis) * std::sin(around),
                       -std::cos(to_axis));
    const auto first = one.project(ray), second = other.project(ray);
    most = std::max(most, first && second ? (*first - *second).norm() : 1e3);
  }
  return most;
}

TEST_P(FisheyeLenses, AreFoundFromBoards) {
  const FisheyeCase& test = GetParam();
  const CameraBoardViews boards = testing::simulate_boards(test, 40, 0.2, 11);
  // The case is worth its name: corners are seen far from the axis.
  const rig::CameraModel model = testing::fisheye_model(test.lens);
  double widest = 0;
  for (const BoardView& view : boards.views) {
    for (const Vector2d& pixel : view.pixels) {
      const auto ray = model.unproject(pixel);
      if (ray) widest = std::max(widest, std::acos(std::clamp(-ray->z(), -1.0, 1.0)));
    }
  }
  EXPECT_GE(widest, 0.93 * test.widest_deg * testing::kTestDegree);

  LensCalibrationOptions options;
  options.model.projection = test.lens.projection;
  const LensCalibration found = calibrate_lens(boards, options);
  EXPECT_THAT(found.reasons, ::testing::IsEmpty());
  EXPECT_EQ(found.views, 40);
  EXPECT_LE(found.outliers, found.corners / 200);
  EXPECT_NEAR(found.rms_px, 0.2 * std::sqrt(2.0), 0.02);
  EXPECT_LE(found.rms_px, 0.3);
  expect_true_lens(found.lens, found.deviations, test.lens);
  EXPECT_LE(largest_difference_px(found.lens, test.lens, 0.9 * widest), 0.5);
}

TEST_P(FisheyeLenses, AreFoundFromALight) {
  const FisheyeCase& test = GetParam();
  const testing::SyntheticArray array = testing::make_fisheye_array(test, 200, 0.2, 5);
  CalibrationOptions options;
  options.scale.spacing_m = 0.2;
  // Without a half angle, the distortion would have to be known up to the corners of the pictures.
  options.solve.lens_models.assign(
      array.poses.size(), {test.lens.projection, 1.02 * test.widest_deg * testing::kTestDegree});
  const Calibration found = calibrate(array.detections, options);
  EXPECT_TRUE(found.verdict.is_accepted()) << ::testing::PrintToString(found.verdict.reasons);
  EXPECT_LE(rms_reprojection_error(found.model), 0.3);
  const testing::PoseErrors errors = testing::pose_errors(found.model, array.poses);
  EXPECT_EQ(errors.placed, 9);
  EXPECT_LE(errors.metres, 2e-3);
  EXPECT_LE(errors.degrees, 0.06);
  ASSERT_TRUE(found.uncertainty);
  expect_true_lens(found.model.cameras[0].intrinsics, found.uncertainty->cameras[0]->lens,
                   test.lens);
  const schemas::RigDocument rig = make_rig_document(found, {}, "found");
  EXPECT_EQ(rig.cameras.front().geometry.intrinsics.projection, test.lens.projection);
  EXPECT_EQ(rig.cameras.front().geometry.intrinsics.half_angle,
            options.solve.lens_models.front().half_angle);
}

INSTANTIATE_TEST_SUITE_P(All, FisheyeLenses,
                         ::testing::Values(testing::fisheye_case(Projection::kFisheye, 90),
                                           testing::fisheye_case(Projection::kFtheta, 110),
                                           testing::fisheye_case(Projection::kEquisolid, 115),
                                           testing::fisheye_case(Projection::kOrthographic, 75)));

}  // namespace
}  // namespace raystage::calibrate
