// SPDX-License-Identifier: Apache-2.0
// Calibrates known cameras from simulated board corners, without pictures.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "base/error.h"
#include "calibrate/geometry/board_array.h"
#include "calibrate/geometry/calibration.h"
#include "testing/calibrate/test_synthetic_array.h"

namespace raystage::calibrate {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr int kAcross = 9, kDown = 6;

BoardObjectPoints board_corners() {
  BoardObjectPoints corners;
  for (int i = 0; i < kAcross * kDown; ++i) {
    const int row = i / kAcross, column = i % kAcross;
    corners.emplace_back(0.03 * column, 0.03 * row);
  }
  return corners;
}

const schemas::Intrinsics kLens{620, 620, 325, 236, {-0.15, 0.04, 0, 0, 0}};
const rig::CameraModel kModel({"c", 640, 480, kLens, {}, {}, {}});

/// Returns the pose of a moving, tilting board at an instant.
rig::Pose board_at(int instant, double most_tilt_deg) {
  const double t = 0.37 * instant, tilt = most_tilt_deg * testing::kTestDegree;
  rig::Pose pose;
  pose.world_from_camera_rotation =
      (Eigen::AngleAxisd(tilt * std::sin(1.1 * t), Vector3d::UnitY()) *
       Eigen::AngleAxisd(tilt * std::cos(1.7 * t), Vector3d::UnitX()) *
       Eigen::AngleAxisd(0.4 * std::sin(0.7 * t), Vector3d::UnitZ()))
          .toRotationMatrix();
  const Vector3d middle(0.5 * 0.03 * (kAcross - 1), -0.5 * 0.03 * (kDown - 1), 0);
  pose.position =
      Vector3d(0.18 * std::sin(t), 0.12 * std::sin(1.3 * t + 1), -0.6 - 0.12 * std::sin(0.5 * t)) -
      pose.world_from_camera_rotation * middle;
  return pose;
}

Detections seen_by(const std::vector<rig::Pose>& cameras, int instants, double tilt,
                   double noise_px) {
  std::mt19937 random(5);
  std::normal_distribution<double> normal(0, noise_px);
  const BoardObjectPoints corners = board_corners();
  Detections detections;
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    detections.cameras.push_back({fmt::format("c{}", c), 640, 480});
  }
  for (int t = 0; t < instants; ++t) {
    for (std::size_t i = 0; i < corners.size(); ++i) {
      const Vector3d place =
          board_at(t, tilt).world_from_camera({corners[i].x(), -corners[i].y(), 0});
      for (std::size_t c = 0; c < cameras.size(); ++c) {
        const auto pixel = kModel.project(cameras[c].camera_from_world(place));
        if (!pixel || !kModel.contains(*pixel)) continue;
        detections.detections.push_back({static_cast<int>(c),
                                         t * static_cast<int>(corners.size()) + static_cast<int>(i),
                                         *pixel + Vector2d(normal(random), normal(random))});
      }
    }
  }
  return detections;
}

TEST(BoardLenses, AreFoundByZhangsMethod) {
  const auto views = collect_board_views(seen_by({rig::Pose{}}, 25, 40, 0.2), 0, board_corners());
  const LensCalibration found = calibrate_lens({"c0", 640, 480, views}, {});
  EXPECT_THAT(found.reasons, ::testing::IsEmpty());
  EXPECT_NEAR(found.lens.fx, kLens.fx, 4 * found.deviations[0]);
  EXPECT_NEAR(found.lens.fx, kLens.fx, 0.005 * kLens.fx);
  EXPECT_EQ(found.lens.fx, found.lens.fy);
  EXPECT_NEAR(found.lens.cx, kLens.cx, 2.5);
  EXPECT_NEAR(found.lens.distortion.k1, kLens.distortion.k1, 0.01);
  EXPECT_NEAR(found.rms_px, 0.2 * std::sqrt(2.0), 0.02);
  EXPECT_GT(found.max_tilt_deg, 30);
}

TEST(BoardLenses, OfBoardsHeldFlatAreNotVouchedFor) {
  const auto views = collect_board_views(seen_by({rig::Pose{}}, 25, 0.5, 0.2), 0, board_corners());
  const LensCalibration found = calibrate_lens({"c0", 640, 480, views}, {});
  EXPECT_THAT(found.reasons, ::testing::Not(::testing::IsEmpty()));
  EXPECT_THAT(found.next_steps, ::testing::Contains(::testing::HasSubstr("tilted")));
  EXPECT_THROW(calibrate_lens({"c0", 640, 480, {views[0], views[1]}}, {}), Error);
}

TEST(BoardLenses, OfOneKindHelpEachOther) {
  // The second camera observes a nearly untilted board, which alone hardly determines its lens.
  const CameraBoardViews tilted{
      "c0", 640, 480, collect_board_views(seen_by({rig::Pose{}}, 25, 40, 0.2), 0, board_corners())};
  CameraBoardViews flat{
      "c1", 640, 480, collect_board_views(seen_by({rig::Pose{}}, 25, 3, 0.2), 0, board_corners())};
  constexpr double kAside = 17;  // pixels; its sensor is shifted
  for (BoardView& view : flat.views) {
    for (Vector2d& pixel : view.pixels) pixel.x() += kAside;
  }
  const LensCalibration alone = calibrate_lens(flat, {});
  EXPECT_THAT(alone.reasons, ::testing::Not(::testing::IsEmpty()));
  const auto found = calibrate_lenses_with_shared_prior(std::vector{tilted, flat}, {});
  ASSERT_EQ(found.size(), 2U);
  for (const LensCalibration& lens : found) {
    EXPECT_THAT(lens.reasons, ::testing::IsEmpty());
    EXPECT_NEAR(lens.lens.fx, kLens.fx, 0.005 * kLens.fx);
    EXPECT_NEAR(lens.lens.distortion.k1, kLens.distortion.k1, 0.01);
    EXPECT_LT(lens.deviations[0], 0.01 * kLens.fx);
  }
  EXPECT_GT(found[1].deviations[0], 0.002 * kLens.fx) << "the other's, and what lenses differ by";
  EXPECT_NEAR(found[0].lens.cx, kLens.cx, 2.5);
  EXPECT_NEAR(found[1].lens.cx, kLens.cx + kAside, 4 * found[1].deviations[2]);
  EXPECT_GT(std::abs(found[1].lens.cx - found[0].lens.cx), 5);
  EXPECT_EQ(found[1].views, 25);
  EXPECT_THROW(calibrate_lenses_with_shared_prior(std::vector{tilted, {"c2", 640, 480, {}}}, {}),
               Error);
}

TEST(BoardLenses, OfAnotherKindAreToldApart) {
  const auto seen = [](double zoom) {
    CameraBoardViews camera{
        "c", 640, 480,
        collect_board_views(seen_by({rig::Pose{}}, 25, 40, 0.2), 0, board_corners())};
    for (BoardView& view : camera.views) {
      for (Vector2d& pixel : view.pixels) {
        pixel = Vector2d(kLens.cx, kLens.cy) + zoom * (pixel - Vector2d(kLens.cx, kLens.cy));
      }
    }
    return camera;
  };
  const auto found = calibrate_lenses_with_shared_prior(std::vector{seen(1), seen(1.04)}, {});
  EXPECT_THAT(found[0].reasons, ::testing::Contains(::testing::HasSubstr("not of one kind")));
  EXPECT_THAT(found[1].reasons, ::testing::Contains(::testing::HasSubstr("not of one kind")));
  std::vector other_size{seen(1), seen(1)};
  other_size[1].width = 1280;
  EXPECT_THROW(calibrate_lenses_with_shared_prior(other_size, {}), Error);
}

TEST(BoardLenses, WithManyCornersThatDoNotFitAreNotVouchedFor) {
  CameraBoardViews camera{
      "c", 640, 480, collect_board_views(seen_by({rig::Pose{}}, 25, 40, 0.2), 0, board_corners())};
  for (BoardView& view : camera.views) {
    for (std::size_t i = 0; i < view.pixels.size(); i += 5) view.pixels[i].x() += 9;
  }
  const LensCalibration found = calibrate_lens(camera, {});
  EXPECT_THAT(found.reasons, ::testing::Contains(::testing::HasSubstr("corners do not fit")));
}

TEST(BoardArrays, HaveMetresAndLenses) {
  std::vector<rig::Pose> cameras(4);
  for (std::size_t c = 0; c < 4; ++c) {
    const std::size_t row = c / 2, column = c % 2;
    cameras[c].position = {0.12 * static_cast<double>(column), 0.1 * static_cast<double>(row), 0};
    cameras[c].world_from_camera_rotation =
        Eigen::AngleAxisd(0.05 * (static_cast<double>(c) - 1.5), Vector3d(0.3, 1, 0).normalized())
            .toRotationMatrix();
  }
  CalibrationOptions options;
  options.board = board_corners();
  const Calibration found = calibrate(seen_by(cameras, 30, 35, 0.2), options);
  EXPECT_TRUE(found.verdict.is_accepted()) << ::testing::PrintToString(found.verdict.reasons);
  EXPECT_EQ(found.scale_source, "board");
  const testing::PoseErrors errors = testing::pose_errors(found.model, cameras);
  EXPECT_EQ(errors.placed, 4);
  EXPECT_LE(errors.metres, 1e-3);
  EXPECT_LE(errors.degrees, 0.05);
  const double spacing =
      (found.model.cameras[1].pose->position - found.model.cameras[0].pose->position).norm();
  EXPECT_NEAR(spacing, 0.12, 5e-4);
  EXPECT_NEAR(found.model.cameras[2].intrinsics.fx, kLens.fx, 0.005 * kLens.fx);

  // With an initial rig: the world is that of the rig, the scale that of the board.
  options.start = make_rig_document(found, {}, "elsewhere, and too large");
  Vector3d middle = Vector3d::Zero();
  for (schemas::RigDocument::Camera& camera : options.start->cameras) {
    rig::Pose pose = rig::pose_from_matrix(camera.geometry.world_from_camera);
    pose.position = 1.03 * pose.position + Vector3d(5, 0, -2);
    middle += pose.position / 4;
    camera.geometry.world_from_camera = rig::matrix_from_pose(pose);
  }
  const Calibration refined = calibrate(seen_by(cameras, 30, 35, 0.2), options);
  EXPECT_EQ(refined.scale_source, "board");
  const auto place = [&](std::size_t c) { return refined.model.cameras[c].pose->position; };
  EXPECT_NEAR((place(1) - place(0)).norm(), 0.12, 5e-4);
  EXPECT_LE(((place(0) + place(1) + place(2) + place(3)) / 4 - middle).norm(), 1e-6);
}

TEST(BoardArrays, WithoutASharedBoardAreRefused) {
  Detections detections = seen_by({rig::Pose{}, rig::Pose{}}, 10, 35, 0.1);
  const auto count = static_cast<int>(board_corners().size());
  std::erase_if(detections.detections,
                [&](const auto& d) { return (d.point / count) % 2 != d.camera; });
  CalibrationOptions options;
  options.board = board_corners();
  EXPECT_THROW(calibrate(detections, options), Error);
}

}  // namespace
}  // namespace raystage::calibrate
