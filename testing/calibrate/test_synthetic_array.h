// SPDX-License-Identifier: Apache-2.0
// For tests: synthetic arrays with known truth.
#pragma once

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <numbers>
#include <random>

#include "calibrate/geometry/alignment.h"
#include "calibrate/geometry/detections.h"
#include "rig/camera_model.h"

namespace raystage::testing {

constexpr double kTestDegree = std::numbers::pi / 180;

/// The true poses and lens of an array, and its detections.
struct SyntheticArray {
  std::vector<rig::Pose> poses;
  schemas::Intrinsics lens;  // of all
  calibrate::Detections detections;
  std::vector<Eigen::Vector3d> lights = {};  // world; only of make_fisheye_array()
};

struct SyntheticArrayOptions {
  int rows = 8, columns = 8;
  double spacing = 0.06, mounting_m = 0.005, mounting_deg = 2;
  int points = 100;
  double noise_px = 0.2, outliers = 0.05, missing = 0.2;
  bool points_on_a_plane = false;
  double nearest = 0.8, farthest = 3;  // metres in front of the array
  int repetitions = 1;                 // of each point: the light does not move
  unsigned seed = 11;
};

inline SyntheticArray make_synthetic_array(const SyntheticArrayOptions& s) {
  std::mt19937 random(s.seed);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> share(0, 1);
  constexpr int kWidth = 640, kHeight = 480;
  const double focal = kWidth / 2.0 / std::tan(31 * kTestDegree);
  // 5 % at the corner.
  const double corner2 = (320.0 * 320 + 240 * 240) / (focal * focal);
  const schemas::Distortion lens{-0.05 / corner2, 0, 0, 0, 0};
  std::vector<Eigen::Vector3d> lights;
  while (static_cast<int>(lights.size()) < s.points) {
    const double depth = s.points_on_a_plane ? (s.nearest + s.farthest) / 2
                                             : s.nearest + (s.farthest - s.nearest) * share(random);
    lights.emplace_back(depth * 0.5 * (2 * share(random) - 1),
                        depth * 0.4 * (2 * share(random) - 1), -depth);
  }
  SyntheticArray result;
  for (int i = 0; i < s.rows * s.columns; ++i) {
    const Eigen::Vector3d off = s.mounting_m / std::sqrt(3.0) *
                                Eigen::Vector3d(normal(random), normal(random), normal(random));
    const Eigen::Vector3d turn = s.mounting_deg * kTestDegree / std::sqrt(3.0) *
                                 Eigen::Vector3d(normal(random), normal(random), normal(random));
    rig::Pose pose;
    const int row = i / s.columns, column = i % s.columns;
    pose.position = Eigen::Vector3d((column - (s.columns - 1) / 2.0) * s.spacing,
                                    (row - (s.rows - 1) / 2.0) * s.spacing, 0) +
                    off;
    if (turn.norm() > 0) {
      pose.world_from_camera_rotation =
          Eigen::AngleAxisd(turn.norm(), turn.normalized()).toRotationMatrix();
    }
    result.poses.push_back(pose);
    const std::string id = fmt::format("c{:02}", i);
    result.detections.cameras.push_back({id, kWidth, kHeight});
    result.lens = {focal, focal, 322, 238, lens};
    const rig::CameraModel model({id, kWidth, kHeight, result.lens, {}, {}, {}});
    for (int point = 0; point < s.points; ++point) {
      const auto pixel = model.project(pose.camera_from_world(lights[point]));
      if (!pixel || !model.contains(*pixel) || share(random) < s.missing) continue;
      Eigen::Vector2d seen = *pixel + s.noise_px * Eigen::Vector2d(normal(random), normal(random));
      if (share(random) < s.outliers) seen = {kWidth * share(random), kHeight * share(random)};
      for (int time = 0; time < s.repetitions; ++time) {
        result.detections.detections.push_back({i, point + time * s.points, seen});
      }
    }
  }
  std::ranges::sort(result.detections.detections, {},
                    [](const auto& d) { return std::pair(d.point, d.camera); });
  return result;
}

/// Largest differences from the truth after alignment.
struct PoseErrors {
  double metres = 0, degrees = 0;
  int placed = 0;
};

inline PoseErrors pose_errors(const calibrate::ArrayModel& model,
                              const std::vector<rig::Pose>& truth) {
  std::vector<rig::Pose> found, expected;
  for (std::size_t i = 0; i < truth.size(); ++i) {
    if (!model.cameras[i].pose) continue;
    found.push_back(*model.cameras[i].pose);
    expected.push_back(truth[i]);
  }
  const calibrate::SimilarityTransform back = calibrate::estimate_similarity(found, expected);
  PoseErrors errors;
  errors.placed = static_cast<int>(found.size());
  for (std::size_t i = 0; i < found.size(); ++i) {
    const rig::Pose pose = back(found[i]);
    errors.metres = std::max(errors.metres, (pose.position - expected[i].position).norm());
    const double cosine =
        std::min(1.0, pose.viewing_direction().dot(expected[i].viewing_direction()));
    errors.degrees = std::max(errors.degrees, std::acos(cosine) / kTestDegree);
  }
  return errors;
}

}  // namespace raystage::testing
