// SPDX-License-Identifier: Apache-2.0
// For tests: boards and lights before simulated fisheyes.
#pragma once

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <random>
#include <utility>
#include <vector>

#include "calibrate/geometry/lens_calibration.h"
#include "testing/calibrate/test_synthetic_array.h"

namespace raystage::testing {

constexpr int kFisheyeWidth = 800, kFisheyeHeight = 720;

/// A fisheye and the largest angle to its axis, degrees, at which it is tested.
struct FisheyeCase {
  schemas::Intrinsics lens;
  double widest_deg = 90;
};

/// Returns a lens whose largest angle is at the edge of the picture, with a distortion of some
/// percent there.
inline FisheyeCase fisheye_case(schemas::Projection projection, double widest_deg) {
  FisheyeCase result;
  result.widest_deg = widest_deg;
  schemas::Intrinsics& lens = result.lens;
  lens.projection = projection;
  const double end = rig::radial_projection(projection).distance(widest_deg * kTestDegree);
  lens.radial_distortion = {-0.03 / (end * end), 0.01 / (end * end * end * end), 0, 0};
  lens.fx = lens.fy = 350 / (0.98 * end);
  lens.cx = kFisheyeWidth / 2.0 + 7;
  lens.cy = kFisheyeHeight / 2.0 - 5;
  return result;
}

inline rig::CameraModel fisheye_model(const schemas::Intrinsics& lens) {
  return rig::CameraModel({"c", kFisheyeWidth, kFisheyeHeight, lens, {}, {}, {}});
}

/// Returns a direction in the camera at an angle to its axis, uniform over the sphere up to the
/// angle.
inline Eigen::Vector3d random_direction(double largest_angle, std::mt19937& random) {
  std::uniform_real_distribution<double> share(0, 1);
  const double cosine = 1 - share(random) * (1 - std::cos(largest_angle));
  const double sine = std::sqrt(1 - cosine * cosine), around = 2 * std::numbers::pi * share(random);
  return {sine * std::cos(around), sine * std::sin(around), -cosine};
}

/// A board and its noise in pictures.
struct BoardSimulation {
  int columns = 9, rows = 6;  ///< corners
  double square = 0.03;       ///< metres
  double nearest = 0.22, farthest = 0.4;
  double tilt_deg = 40;
};

/// Returns views of boards that face the camera and are tilted, spread over all directions up to
/// the widest angle of the case. Corners beyond it are not seen. `noise`: returns the error of a
/// corner, pixels.
template <class Noise>
calibrate::CameraBoardViews simulate_boards_with(const FisheyeCase& test, int views,
                                                 const BoardSimulation& board, unsigned seed,
                                                 Noise&& noise) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> share(0, 1);
  const rig::CameraModel model = fisheye_model(test.lens);
  const double widest = test.widest_deg * kTestDegree;
  calibrate::CameraBoardViews result{"fisheye", kFisheyeWidth, kFisheyeHeight, {}};
  while (static_cast<int>(result.views.size()) < views) {
    const Eigen::Vector3d towards = random_direction(widest, random);
    const double tilt = board.tilt_deg * kTestDegree;
    const Eigen::Matrix3d camera_from_board =
        (Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d(0, 0, -1), towards) *
         Eigen::AngleAxisd(tilt * (2 * share(random) - 1), Eigen::Vector3d::UnitX()) *
         Eigen::AngleAxisd(tilt * (2 * share(random) - 1), Eigen::Vector3d::UnitY()) *
         Eigen::AngleAxisd(6.3 * share(random), Eigen::Vector3d::UnitZ()))
            .toRotationMatrix();
    const double distance = board.nearest + (board.farthest - board.nearest) * share(random);
    calibrate::BoardView view;
    view.frame = static_cast<int>(result.views.size());
    for (int i = 0; i < board.columns * board.rows; ++i) {
      const int column = i % board.columns, row = i / board.columns;
      const Eigen::Vector2d corner(board.square * column, board.square * row);
      const Eigen::Vector3d from_middle(corner.x() - board.square * (board.columns - 1) / 2,
                                        -corner.y() + board.square * (board.rows - 1) / 2, 0);
      const Eigen::Vector3d in_camera = distance * towards + camera_from_board * from_middle;
      const double angle = std::acos(-in_camera.normalized().z());
      const auto pixel = model.project(in_camera);
      if (!pixel || angle > widest || !model.contains(*pixel)) continue;
      view.object_points.push_back(corner);
      view.pixels.push_back(*pixel + noise(random));
    }
    if (view.pixels.size() >= 12) result.views.push_back(std::move(view));
  }
  return result;
}

inline calibrate::CameraBoardViews simulate_boards(const FisheyeCase& test, int views,
                                                   double noise_px, unsigned seed) {
  std::normal_distribution<double> normal(0, noise_px);
  return simulate_boards_with(test, views, {}, seed, [&](std::mt19937& random) {
    const double x = normal(random);
    return Eigen::Vector2d(x, normal(random));
  });
}

/// Returns 3x3 cameras, 0.2 m apart and rotated by up to some 30 degrees, and a light around them:
/// beside and, for lenses that see so far, behind. Every camera misses some and has some outliers.
inline SyntheticArray make_fisheye_array(const FisheyeCase& test, int points, double noise_px,
                                         unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> share(0, 1);
  const rig::CameraModel model = fisheye_model(test.lens);
  const double widest = test.widest_deg * kTestDegree;
  std::vector<Eigen::Vector3d> lights;
  for (int i = 0; i < points; ++i) {
    lights.push_back((0.5 + 2 * share(random)) * random_direction(widest + 0.3, random));
  }
  SyntheticArray result;
  result.lens = test.lens;
  result.lights = lights;
  for (int i = 0; i < 9; ++i) {
    const int column = i % 3 - 1, row = i / 3 - 1;
    rig::Pose pose;
    pose.position = Eigen::Vector3d(0.2 * column, 0.2 * row, 0) +
                    0.01 * Eigen::Vector3d(normal(random), normal(random), normal(random));
    pose.world_from_camera_rotation =
        (Eigen::AngleAxisd(-0.35 * column + 0.05 * normal(random), Eigen::Vector3d::UnitY()) *
         Eigen::AngleAxisd(0.35 * row + 0.05 * normal(random), Eigen::Vector3d::UnitX()) *
         Eigen::AngleAxisd(0.1 * normal(random), Eigen::Vector3d::UnitZ()))
            .toRotationMatrix();
    result.poses.push_back(pose);
    result.detections.cameras.push_back({fmt::format("c{}", i), kFisheyeWidth, kFisheyeHeight});
    for (int point = 0; point < points; ++point) {
      const Eigen::Vector3d in_camera = pose.camera_from_world(lights[point]);
      const auto pixel = model.project(in_camera);
      if (!pixel || !model.contains(*pixel) || share(random) < 0.1) continue;
      if (std::acos(-in_camera.normalized().z()) > widest) continue;
      Eigen::Vector2d seen = *pixel + noise_px * Eigen::Vector2d(normal(random), normal(random));
      if (share(random) < 0.03) {
        seen = {kFisheyeWidth * share(random), kFisheyeHeight * share(random)};
      }
      result.detections.detections.push_back({i, point, seen});
    }
  }
  std::ranges::sort(result.detections.detections, {},
                    [](const auto& d) { return std::pair(d.point, d.camera); });
  return result;
}

}  // namespace raystage::testing
