// SPDX-License-Identifier: Apache-2.0
// Boards before a simulated fisheye with the noise of captured ones: distances, tilts, visible
// corners and residuals are those of the boards that four webcams recorded.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <random>

#include "calibrate/detect/board_detection.h"
#include "calibrate/geometry/board_view_model.h"
#include "calibrate/geometry/bundle_adjustment.h"
#include "calibrate/geometry/lens_calibration.h"
#include "ingest/import_take.h"
#include "testing/calibrate/test_fisheyes.h"
#include "testing/test_data.h"
#include "testing/test_folder.h"

namespace raystage::calibrate {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;
using schemas::Projection;

/// A board as a webcam recorded it.
struct CapturedBoard {
  std::vector<Vector2d> object_points;
  rig::Pose camera_from_board;
  double focal_length = 0;          // of the webcam, pixels
  std::vector<Vector2d> residuals;  // of the corners, pixels
};

/// Returns the boards that the cameras saw, each with the pose and lens that fit it best.
std::vector<CapturedBoard> captured_boards(const store::Take& take) {
  const BoardDetector finder({4, 5, 0.054, "4x4_1000", 0.75, true});
  std::vector<CapturedBoard> boards;
  for (int camera = 0; camera < take.camera_count(); ++camera) {
    const auto& recorded = take.rig().cameras[camera].model;
    const CameraBoardViews seen{"webcam", recorded.width(), recorded.height(),
                                detect_board_views(take, camera, finder, 60, [](double) {}, {})};
    const LensCalibration found = calibrate_lens(seen, {});
    const BoardViewList views({&seen, 1});
    ArrayModel model = make_board_view_model(views, {&seen, 1}, {&found.lens, 1});
    place_boards(model, views);
    BundleAdjustmentOptions poses;
    poses.fixed_cameras = {true};
    run_bundle_adjustment(model, poses);
    const CameraModels lenses = camera_models(model);
    for (std::size_t b = 0, first = 0; b < model.bodies.size(); ++b) {
      CapturedBoard board;
      const std::size_t corners = model.bodies[b].points.size();
      board.object_points = views.views[b]->object_points;
      board.focal_length = found.lens.fx;
      // The fit of the pose has taken 6 degrees of freedom from the residuals.
      const double freedom = std::sqrt(2.0 * corners / (2.0 * corners - 6));
      for (std::size_t i = first; i < first + corners; ++i) {
        const auto residual = reprojection_residual(model, lenses, model.observations[i]);
        if (residual) board.residuals.push_back(freedom * *residual);
      }
      first += corners;
      if (!model.bodies[b].pose || board.residuals.size() != corners) continue;
      board.camera_from_board = *model.bodies[b].pose;
      boards.push_back(std::move(board));
    }
  }
  return boards;
}

/// Returns the captured boards before a fisheye, turned about its centre into all directions that
/// it sees, and as large in the picture as before the webcam. Each has the residuals of another
/// one.
CameraBoardViews before_fisheye(const std::vector<CapturedBoard>& boards,
                                const testing::FisheyeCase& test, int count, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_int_distribution<std::size_t> any(0, boards.size() - 1);
  const rig::CameraModel model = testing::fisheye_model(test.lens);
  CameraBoardViews result{"fisheye", testing::kFisheyeWidth, testing::kFisheyeHeight, {}};
  while (static_cast<int>(result.views.size()) < count) {
    const CapturedBoard &board = boards[any(random)], &noise = boards[any(random)];
    const Vector3d from = board.camera_from_board.position;
    const Eigen::Matrix3d turn =
        Eigen::Quaterniond::FromTwoVectors(
            from, testing::random_direction(test.widest_deg * testing::kTestDegree, random))
            .toRotationMatrix();
    const double nearer = test.lens.fx / board.focal_length;
    BoardView view;
    view.frame = static_cast<int>(result.views.size());
    for (std::size_t i = 0; i < board.object_points.size(); ++i) {
      const Vector2d& corner = board.object_points[i];
      const Vector3d on_board =
          board.camera_from_board.world_from_camera_rotation * Vector3d(corner.x(), -corner.y(), 0);
      const auto pixel = model.project(turn * (nearer * from + on_board));
      if (!pixel || !model.contains(*pixel)) continue;
      view.object_points.push_back(corner);
      view.pixels.push_back(*pixel + noise.residuals[i % noise.residuals.size()]);
    }
    if (view.pixels.size() >= 6) result.views.push_back(std::move(view));
  }
  return result;
}

TEST(CapturedNoise, OfWebcamsDoesNotHideALensOf200Degrees) {
  const auto manifest = testing::test_data() / "four_webcams" / "import.json";
  if (!std::filesystem::exists(manifest)) GTEST_SKIP() << "no captured boards at " << manifest;
  const testing::TestFolder folder;
  ingest::import_take(schemas::read_import_manifest(manifest), manifest.parent_path(),
                      folder.path() / "take", {});
  const std::vector<CapturedBoard> boards = captured_boards(store::Take(folder.path() / "take"));
  ASSERT_GE(boards.size(), 100U);
  double sum = 0, largest = 0;
  int corners = 0;
  for (const CapturedBoard& board : boards) {
    for (const Vector2d& residual : board.residuals) {
      sum += residual.squaredNorm();
      largest = std::max(largest, residual.norm());
      ++corners;
    }
  }
  const double noise_px = std::sqrt(sum / corners);
  std::printf("captured noise: %.3f px RMS, largest %.2f px, %d corners of %zu boards\n", noise_px,
              largest, corners, boards.size());

  double squares = 0, worst = 0;
  int parameters = 0;
  for (const Projection projection :
       {Projection::kFtheta, Projection::kEquisolid, Projection::kOrthographic}) {
    const testing::FisheyeCase test =
        testing::fisheye_case(projection, projection == Projection::kOrthographic ? 80 : 100);
    for (unsigned seed = 1; seed <= 4; ++seed) {
      LensCalibrationOptions options;
      options.model.projection = projection;
      const LensCalibration found = calibrate_lens(
          before_fisheye(boards, test, 60, seed + 100 * static_cast<unsigned>(projection)),
          options);
      SCOPED_TRACE(fmt::format("projection {}, seed {}", static_cast<int>(projection), seed));
      EXPECT_THAT(found.reasons, ::testing::IsEmpty());
      EXPECT_LE(found.rms_px, 0.3);
      const LensParameters values = lens_parameters(found.lens), truth = lens_parameters(test.lens);
      std::string text;
      for (std::size_t k = 0; k < values.size(); ++k) {
        if (!(found.deviations[k] > 0) || k == 1) continue;  // fy follows fx
        const double error = (values[k] - truth[k]) / found.deviations[k];
        text += fmt::format(" {} {:.4g}+-{:.2g} ({:+.1f})",
                            lens_parameterization(projection).parameters()[k].name, values[k],
                            found.deviations[k], error);
        squares += error * error;
        worst = std::max(worst, std::abs(error));
        ++parameters;
      }
      std::printf("projection %d: %.3f px RMS,%s\n", static_cast<int>(projection), found.rms_px,
                  text.c_str());
    }
  }
  // 60 errors in their stated deviations: RMS 1, up to its own spread, and because the parameters
  // of a lens depend on each other. Stated deviations are enlarged for correlated residuals.
  const double in_deviations = std::sqrt(squares / parameters);
  std::printf("errors in stated deviations: RMS %.2f, largest %.2f of %d\n", in_deviations, worst,
              parameters);
  EXPECT_EQ(parameters, 60);
  EXPECT_GE(in_deviations, 0.6);
  EXPECT_LE(in_deviations, 1.4);
  EXPECT_LE(worst, 4);
}

}  // namespace
}  // namespace raystage::calibrate
