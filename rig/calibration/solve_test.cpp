// SPDX-License-Identifier: Apache-2.0
// Arrays whose truth is known, and real ones whose published error is.
#include "rig/calibration/solve.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <numbers>
#include <random>

#include "rig/calibration/alignment.h"
#include "rig/camera_model.h"
#include "schemas/error.h"
#include "schemas/test_data.h"

namespace raystage {
namespace {

using Eigen::Vector3d;
constexpr double kDegree = std::numbers::pi / 180;

/// An array as it was mounted, and what it saw.
struct Simulated {
  std::vector<Pose> poses;
  Detections detections;
};

struct Simulation {
  int rows = 8, columns = 8;
  double spacing = 0.06, mounting_m = 0.005, mounting_deg = 2;
  int points = 100;
  double noise_px = 0.2, outliers = 0.05, missing = 0.2;
  bool points_on_a_plane = false;
  double farthest = 3;
};

Simulated simulated(const Simulation& s) {
  std::mt19937 random(11);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> share(0, 1);
  constexpr int kWidth = 640, kHeight = 480;
  const double focal = kWidth / 2.0 / std::tan(31 * kDegree);
  // 5 % at the corner.
  const double corner2 = (320.0 * 320 + 240 * 240) / (focal * focal);
  const Distortion lens{-0.05 / corner2, 0, 0, 0, 0};
  std::vector<Vector3d> lights;
  while (static_cast<int>(lights.size()) < s.points) {
    const double depth = s.points_on_a_plane ? 2 : 0.8 + (s.farthest - 0.8) * share(random);
    lights.emplace_back(depth * 0.5 * (2 * share(random) - 1),
                        depth * 0.4 * (2 * share(random) - 1), -depth);
  }
  Simulated result;
  for (int i = 0; i < s.rows * s.columns; ++i) {
    const Vector3d off =
        s.mounting_m / std::sqrt(3.0) * Vector3d(normal(random), normal(random), normal(random));
    const Vector3d turn = s.mounting_deg * kDegree / std::sqrt(3.0) *
                          Vector3d(normal(random), normal(random), normal(random));
    Pose pose;
    pose.position = Vector3d((i % s.columns - (s.columns - 1) / 2.0) * s.spacing,
                             (i / s.columns - (s.rows - 1) / 2.0) * s.spacing, 0) +
                    off;
    if (turn.norm() > 0) {
      pose.world_from_camera_rotation =
          Eigen::AngleAxisd(turn.norm(), turn.normalized()).toRotationMatrix();
    }
    result.poses.push_back(pose);
    const std::string id = fmt::format("c{:02}", i);
    result.detections.cameras.push_back({id, kWidth, kHeight});
    const CameraModel model({id, kWidth, kHeight, {focal, focal, 322, 238, lens}, {}, {}, {}});
    for (int point = 0; point < s.points; ++point) {
      const auto pixel =
          model.project(pose.camera_from_world(lights[static_cast<std::size_t>(point)]));
      if (!pixel || !model.contains(*pixel) || share(random) < s.missing) continue;
      Eigen::Vector2d seen = *pixel + s.noise_px * Eigen::Vector2d(normal(random), normal(random));
      if (share(random) < s.outliers) seen = {kWidth * share(random), kHeight * share(random)};
      result.detections.detections.push_back({i, point, seen});
    }
  }
  std::ranges::sort(result.detections.detections, {},
                    [](const auto& d) { return std::pair(d.point, d.camera); });
  return result;
}

/// Largest differences from the truth after alignment.
struct Errors {
  double metres = 0, degrees = 0;
  int placed = 0;
};

Errors errors_from(const ArrayModel& model, const std::vector<Pose>& truth) {
  std::vector<Pose> found, expected;
  for (std::size_t i = 0; i < truth.size(); ++i) {
    if (!model.cameras[i].pose) continue;
    found.push_back(*model.cameras[i].pose);
    expected.push_back(truth[i]);
  }
  const Similarity back = similarity_between(found, expected);
  Errors errors;
  errors.placed = static_cast<int>(found.size());
  for (std::size_t i = 0; i < found.size(); ++i) {
    const Pose pose = back(found[i]);
    errors.metres = std::max(errors.metres, (pose.position - expected[i].position).norm());
    const double cosine =
        std::min(1.0, pose.viewing_direction().dot(expected[i].viewing_direction()));
    errors.degrees = std::max(errors.degrees, std::acos(cosine) / kDegree);
  }
  return errors;
}

TEST(SolvedArrays, TheThesisArrayIsFoundToAMillimetre) {
  const Simulated truth = simulated({});
  SolveReport report;
  SolveSettings settings;
  settings.horizontal_fov = 60 * kDegree;
  settings.threads = 2;
  const ArrayModel model = solve_array(truth.detections, settings, report);
  const Errors errors = errors_from(model, truth.poses);
  RecordProperty("seconds", fmt::format("{:.1f}", report.seconds));
  EXPECT_EQ(errors.placed, 64);
  EXPECT_LE(report.steps.back().rms_px, 0.3);
  EXPECT_LE(errors.metres, 1e-3);
  EXPECT_LE(errors.degrees, 0.05);
  // Five in a hundred were made up, and a few good ones look it.
  const double outliers = static_cast<double>(report.steps.back().outliers) /
                          static_cast<double>(model.observations.size());
  EXPECT_NEAR(outliers, 0.05, 0.02);
}

TEST(SolvedArrays, WhatSeesNothingHasNoPose) {
  Simulated truth = simulated({.rows = 2, .columns = 3});
  std::erase_if(truth.detections.detections, [](const auto& d) { return d.camera == 4; });
  SolveReport report;
  const ArrayModel model = solve_array(truth.detections, {.horizontal_fov = 60 * kDegree}, report);
  EXPECT_FALSE(model.cameras[4].pose);
  EXPECT_EQ(errors_from(model, truth.poses).placed, 5);
  truth.detections.detections.clear();
  EXPECT_THROW(solve_array(truth.detections, {}, report), Error);
}

/// Svoboda's MultiCamSelfCal states 0.62 px in the mean.
TEST(SolvedArrays, AMovingLightIsExplainedAsWellAsPublished) {
  const auto folder = test_data() / "led_points" / "DATA20100906_134124";
  if (!std::filesystem::exists(folder)) GTEST_SKIP() << "no captured detections at " << folder;
  const Detections detections =
      read_detections(folder / "detections.csv", read_detections_document(folder / "cameras.json"));
  SolveReport report;
  SolveSettings settings;
  settings.lens_per_camera = true;
  settings.threads = 2;
  const ArrayModel model = solve_array(detections, settings, report);
  std::string steps;
  for (const SolveReport::Step& step : report.steps) {
    steps += fmt::format("{}: {:.3f} px, {} of {} left out\n", step.what, step.rms_px,
                         step.outliers, step.outliers + step.observations);
  }
  SCOPED_TRACE(steps);
  const std::vector<double> errors = errors_of(model);
  double sum = 0;
  for (const double error : errors) sum += error;
  EXPECT_LE(sum / static_cast<double>(errors.size()), 0.62);
  std::vector<std::size_t> seen(model.points.size(), 0), kept(model.points.size(), 0);
  for (const ArrayModel::Observation& observation : model.observations) {
    ++seen[static_cast<std::size_t>(observation.point)];
    kept[static_cast<std::size_t>(observation.point)] += model.counts(observation) ? 1 : 0;
  }
  int by_all = 0, kept_by_all = 0;
  for (std::size_t i = 0; i < seen.size(); ++i) {
    if (seen[i] < model.cameras.size()) continue;
    ++by_all;
    kept_by_all += kept[i] == seen[i] ? 1 : 0;
  }
  EXPECT_GT(by_all, 300);
  EXPECT_GE(kept_by_all, 0.9 * by_all);
}

}  // namespace
}  // namespace raystage
