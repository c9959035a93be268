// SPDX-License-Identifier: Apache-2.0
// Calibrates simulated arrays of fisheyes, whose truth is known, from a light and from boards.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "calibrate/geometry/board_array.h"
#include "calibrate/geometry/calibration.h"
#include "calibrate/geometry/calibration_report.h"
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

// Boards that face the camera are not tilted, although those at the side are upright to its axis.
TEST(FisheyeBoards, AreTiltedAgainstTheDirectionInWhichTheyAreSeen) {
  const FisheyeCase test = testing::fisheye_case(Projection::kFtheta, 100);
  testing::BoardSimulation board;
  board.nearest = 0.4;  // the middle of what is seen of a board is near its own
  board.farthest = 0.5;
  const auto largest_tilt = [&](double tilt_deg) {
    board.tilt_deg = tilt_deg;
    const CameraBoardViews boards = testing::simulate_boards_with(
        test, 24, board, 5, [](std::mt19937&) { return Vector2d(0, 0); });
    LensCalibrationOptions options;
    options.model.projection = Projection::kFtheta;
    return calibrate_lens(boards, options).max_tilt_deg;
  };
  EXPECT_LT(largest_tilt(5), 20);
  EXPECT_GT(largest_tilt(40), 30);
  EXPECT_LT(largest_tilt(40), 65);
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

TEST(FisheyeArrays, MayHaveOtherLensesBesideThem) {
  // Two of nine cameras are pinholes: their pictures are simulated again.
  const FisheyeCase wide = testing::fisheye_case(Projection::kEquisolid, 100);
  testing::SyntheticArray array = testing::make_fisheye_array(wide, 250, 0.2, 9);
  const FisheyeCase narrow{{420, 420, 404, 357, {-0.05, 0.01, 0, 0, 0}}, 50};
  CalibrationOptions options;
  options.scale.spacing_m = 0.2;
  const auto is_pinhole = [](int camera) { return camera == 2 || camera == 4; };
  // Poses and lights are those of the same seed; pinholes see those of a smaller cap.
  std::erase_if(array.detections.detections, [&](const auto& d) { return is_pinhole(d.camera); });
  const rig::CameraModel pinhole = testing::fisheye_model(narrow.lens);
  std::mt19937 random(2);
  std::normal_distribution<double> noise(0, 0.2);
  for (const int camera : {2, 4}) {
    for (std::size_t point = 0; point < array.lights.size(); ++point) {
      const auto pixel = pinhole.project(
          array.poses[static_cast<std::size_t>(camera)].camera_from_world(array.lights[point]));
      if (!pixel || !pinhole.contains(*pixel)) continue;
      array.detections.detections.push_back(
          {camera, static_cast<int>(point), *pixel + Vector2d(noise(random), noise(random))});
    }
  }
  std::ranges::sort(array.detections.detections, {},
                    [](const auto& d) { return std::pair(d.point, d.camera); });
  for (int camera = 0; camera < 9; ++camera) {
    options.solve.lenses.push_back(is_pinhole(camera) ? narrow.lens : wide.lens);
    // Initial values, and not the truth.
    options.solve.lenses.back().fx *= 1.01;
    options.solve.lenses.back().fy *= 1.01;
    options.solve.lenses.back().radial_distortion = {};
  }
  const Calibration found = calibrate(array.detections, options);
  EXPECT_LE(rms_reprojection_error(found.model), 0.3);
  const testing::PoseErrors errors = testing::pose_errors(found.model, array.poses);
  EXPECT_EQ(errors.placed, 9);
  EXPECT_LE(errors.metres, 5e-3);
  EXPECT_LE(errors.degrees, 0.15);
  ASSERT_TRUE(found.uncertainty);
  for (std::size_t camera = 0; camera < 9; ++camera) {
    SCOPED_TRACE(camera);
    const schemas::Intrinsics& lens = found.model.cameras[camera].intrinsics;
    const bool narrow_here = is_pinhole(static_cast<int>(camera));
    EXPECT_EQ(lens.projection, narrow_here ? Projection::kPinhole : Projection::kEquisolid);
    EXPECT_NEAR(lens.fx, narrow_here ? 420 : wide.lens.fx,
                4.5 * found.uncertainty->cameras[camera]->lens[0]);
  }
  const std::string page = calibration_report_html(found, "mixed");
  EXPECT_THAT(page, ::testing::HasSubstr("<th>p2</th><th>k3</th>"));
  EXPECT_THAT(page, ::testing::HasSubstr("<th>k3</th><th>k4</th>"));
  EXPECT_THAT(calibration_report_json(found), ::testing::HasSubstr("equisolid"));
}

/// Detections of boards that several fisheyes see, as calibrate() takes them.
TEST(FisheyeArrays, ArePlacedByBoards) {
  const FisheyeCase test = testing::fisheye_case(Projection::kFtheta, 100);
  const rig::CameraModel model = testing::fisheye_model(test.lens);
  std::vector<rig::Pose> poses(3);
  BoardObjectPoints corners;
  for (int row = 0; row < 6; ++row) {
    for (int column = 0; column < 9; ++column) corners.emplace_back(0.03 * column, 0.03 * row);
  }
  Detections detections;
  for (std::size_t c = 0; c < poses.size(); ++c) {
    poses[c].position = {0.15 * (static_cast<double>(c) - 1), 0.02 * static_cast<double>(c), 0};
    poses[c].world_from_camera_rotation =
        Eigen::AngleAxisd(-0.4 * (static_cast<double>(c) - 1), Vector3d::UnitY())
            .toRotationMatrix();
    detections.cameras.push_back(
        {fmt::format("c{}", c), testing::kFisheyeWidth, testing::kFisheyeHeight});
  }
  // Boards of the simulation of one camera, in the world of its pose.
  std::mt19937 random(8);
  std::normal_distribution<double> noise(0, 0.2);
  std::uniform_real_distribution<double> share(-1, 1);
  for (int instant = 0; instant < 40; ++instant) {
    const Vector3d towards = testing::random_direction(1.6, random);
    const Eigen::Matrix3d turn = (Eigen::Quaterniond::FromTwoVectors(Vector3d(0, 0, -1), towards) *
                                  Eigen::AngleAxisd(0.6 * share(random), Vector3d::UnitX()) *
                                  Eigen::AngleAxisd(0.6 * share(random), Vector3d::UnitY()))
                                     .toRotationMatrix();
    for (std::size_t i = 0; i < corners.size(); ++i) {
      const Vector3d place =
          0.4 * towards + turn * Vector3d(corners[i].x() - 0.12, 0.075 - corners[i].y(), 0);
      for (std::size_t c = 0; c < poses.size(); ++c) {
        const Vector3d in_camera = poses[c].camera_from_world(place);
        const auto pixel = model.project(in_camera);
        const bool is_seen = pixel && model.contains(*pixel) &&
                             std::acos(-in_camera.normalized().z()) < 100 * testing::kTestDegree;
        if (!is_seen) continue;
        detections.detections.push_back({static_cast<int>(c), 54 * instant + static_cast<int>(i),
                                         *pixel + Vector2d(noise(random), noise(random))});
      }
    }
  }
  CalibrationOptions options;
  options.board = corners;
  options.solve.lens_models.assign(3, {Projection::kFtheta, 101 * testing::kTestDegree});
  const Calibration found = calibrate(detections, options);
  EXPECT_TRUE(found.verdict.is_accepted()) << ::testing::PrintToString(found.verdict.reasons);
  EXPECT_EQ(found.scale_source, "board");
  EXPECT_LE(rms_reprojection_error(found.model), 0.3);
  const testing::PoseErrors errors = testing::pose_errors(found.model, poses);
  EXPECT_EQ(errors.placed, 3);
  EXPECT_LE(errors.metres, 1e-3);
  EXPECT_LE(errors.degrees, 0.05);
  const double apart =
      (found.model.cameras[2].pose->position - found.model.cameras[0].pose->position).norm();
  EXPECT_NEAR(apart, (poses[2].position - poses[0].position).norm(), 1e-3);
}

TEST(FisheyeBoards, OfOneTypeHelpEachOther) {
  const FisheyeCase test = testing::fisheye_case(Projection::kFtheta, 100);
  const CameraBoardViews many = testing::simulate_boards(test, 40, 0.2, 1);
  const CameraBoardViews few = testing::simulate_boards(test, 4, 0.2, 2);
  LensCalibrationOptions options;
  options.model.projection = Projection::kFtheta;
  const LensCalibration alone = calibrate_lens(few, options);
  const auto shared = calibrate_lenses_with_shared_prior(std::vector{many, few}, options);
  ASSERT_EQ(shared.size(), 2U);
  for (const LensCalibration& lens : shared) {
    EXPECT_EQ(lens.lens.projection, Projection::kFtheta);
    EXPECT_THAT(lens.reasons, ::testing::IsEmpty());
  }
  EXPECT_LT(largest_difference_px(shared[1].lens, test.lens, 1.7),
            largest_difference_px(alone.lens, test.lens, 1.7));
}

TEST(FisheyeBoards, RefineAllTermsWithTheFullModel) {
  FisheyeCase test = testing::fisheye_case(Projection::kFtheta, 100);
  test.lens.radial_distortion = {-0.02, 0.006, -0.002, 0.0002};
  test.lens.fy = 1.004 * test.lens.fx;
  const CameraBoardViews boards = testing::simulate_boards(test, 40, 0.2, 4);
  LensCalibrationOptions options;
  options.model.projection = Projection::kFtheta;
  options.full_lens_model = true;
  const LensCalibration found = calibrate_lens(boards, options);
  EXPECT_NEAR(found.rms_px, 0.2 * std::sqrt(2.0), 0.02);
  expect_true_lens(found.lens, found.deviations, test.lens);
  for (std::size_t k = 0; k < 8; ++k) EXPECT_GT(found.deviations[k], 0) << k;
  EXPECT_EQ(found.deviations[8], 0);
}

INSTANTIATE_TEST_SUITE_P(All, FisheyeLenses,
                         ::testing::Values(testing::fisheye_case(Projection::kFisheye, 90),
                                           testing::fisheye_case(Projection::kFtheta, 110),
                                           testing::fisheye_case(Projection::kEquisolid, 115),
                                           testing::fisheye_case(Projection::kOrthographic, 75)));

}  // namespace
}  // namespace raystage::calibrate
