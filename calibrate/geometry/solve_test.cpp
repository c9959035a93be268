// SPDX-License-Identifier: Apache-2.0
// Solves synthetic arrays with known truth, and captured ones with a published reprojection error.
#include "calibrate/geometry/solve.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>

#include "base/error.h"
#include "calibrate/geometry/initial_poses.h"
#include "calibrate/geometry/solve_steps.h"
#include "testing/calibrate/test_synthetic_array.h"
#include "testing/test_data.h"

namespace raystage::calibrate {
namespace {

TEST(SolvedArrays, TheThesisArrayIsFoundToAMillimetre) {
  const testing::SyntheticArray truth = testing::make_synthetic_array({});
  SolveReport report;
  SolveOptions options;
  options.horizontal_fov = 60 * testing::kTestDegree;
  const ArrayModel model = solve_array(truth.detections, options, report);
  const testing::PoseErrors errors = testing::pose_errors(model, truth.poses);
  RecordProperty("seconds", fmt::format("{:.1f}", report.seconds));
  EXPECT_EQ(errors.placed, 64);
  EXPECT_LE(report.steps.back().rms_px, 0.3);
  EXPECT_LE(errors.metres, 1e-3);
  EXPECT_LE(errors.degrees, 0.05);
  // 5 % of the detections are random; a few correct ones exceed the outlier threshold.
  const double outliers = static_cast<double>(report.steps.back().outliers) /
                          static_cast<double>(model.observations.size());
  EXPECT_NEAR(outliers, 0.05, 0.02);
}

TEST(SolvedArrays, WhatSeesNothingHasNoPose) {
  testing::SyntheticArray truth = testing::make_synthetic_array({.rows = 2, .columns = 3});
  std::erase_if(truth.detections.detections, [](const auto& d) { return d.camera == 4; });
  SolveReport report;
  const ArrayModel model =
      solve_array(truth.detections, {.horizontal_fov = 60 * testing::kTestDegree}, report);
  EXPECT_FALSE(model.cameras[4].pose);
  EXPECT_EQ(testing::pose_errors(model, truth.poses).placed, 5);
  truth.detections.detections.clear();
  EXPECT_THROW(solve_array(truth.detections, {}, report), Error);
}

TEST(SolvedArrays, AreGivenUpWhenAskedTo) {
  const testing::SyntheticArray truth = testing::make_synthetic_array({.rows = 2, .columns = 3});
  SolveReport report;
  std::stop_source source;
  SolveOptions options{.horizontal_fov = 60 * testing::kTestDegree};
  options.stop = source.get_token();
  std::vector<std::string> steps;
  options.on_step = [&](const SolveStep& step) {
    steps.push_back(step.what);
    source.request_stop();
  };
  EXPECT_THROW(solve_array(truth.detections, options, report), Error);
  EXPECT_EQ(steps, std::vector<std::string>{"poses and points"});
  // Already while pairs are rated: many cameras take minutes.
  ArrayModel model = make_initial_model(truth.detections, 60 * testing::kTestDegree);
  InitialPosesOptions poses;
  poses.stop = source.get_token();
  try {
    estimate_initial_poses(model, poses);
    ADD_FAILURE() << "not stopped";
  } catch (const Error& error) {
    EXPECT_EQ(error.exit_code(), ExitCode::kFailed);
  }
  EXPECT_EQ(count_registered_cameras(model), 0);
}

/// Returns the initial model of an array in which the cameras `fine` have six times as many pixels
/// along each side. Lenses are known, and detections are a pixel off in each camera.
ArrayModel mixed_array(testing::SyntheticArray& truth, const std::vector<int>& fine) {
  std::mt19937 random(5);
  std::normal_distribution<double> normal;
  std::vector<double> scales(truth.poses.size(), 1);
  for (const int camera : fine) scales[static_cast<std::size_t>(camera)] = 6;
  for (Detections::Detection& detection : truth.detections.detections) {
    detection.pixel *= scales[static_cast<std::size_t>(detection.camera)];
    detection.pixel += Eigen::Vector2d(normal(random), normal(random));
  }
  ArrayModel model = make_initial_model(truth.detections, 60 * testing::kTestDegree);
  for (std::size_t i = 0; i < scales.size(); ++i) {
    ArrayModel::Camera& camera = model.cameras[i];
    camera.width *= static_cast<int>(scales[i]);
    camera.height *= static_cast<int>(scales[i]);
    camera.intrinsics = truth.lens;
    for (double* length : {&camera.intrinsics.fx, &camera.intrinsics.fy, &camera.intrinsics.cx,
                           &camera.intrinsics.cy}) {
      *length *= scales[i];
    }
  }
  return model;
}

TEST(InitialPoses, CamerasOfAnyResolutionAreRegisteredInAnyOrder) {
  for (const std::vector<int>& fine : {std::vector{0, 2, 4}, {1, 3, 5}, {0}, {5}}) {
    testing::SyntheticArray truth = testing::make_synthetic_array(
        {.rows = 2, .columns = 3, .spacing = 0.2, .noise_px = 0, .outliers = 0, .missing = 0});
    ArrayModel model = mixed_array(truth, fine);
    ASSERT_TRUE(estimate_initial_poses(model, {}));
    const testing::PoseErrors errors = testing::pose_errors(model, truth.poses);
    EXPECT_EQ(errors.placed, 6) << fine.size() << " from camera " << fine[0];
    EXPECT_LE(errors.metres, 0.02);
  }
}

/// Solves a captured recording of a light, with a lens for each camera.
ArrayModel solved_light(const std::filesystem::path& folder, SolveReport& report) {
  const Detections detections = read_detections(
      folder / "detections.csv", schemas::read_detections_document(folder / "cameras.json"));
  SolveOptions options;
  options.lens_per_camera = true;
  return solve_array(detections, options, report);
}

/// MultiCamSelfCal (Svoboda) reports a mean error of 0.62 px.
TEST(SolvedArrays, AMovingLightIsExplainedAsWellAsPublished) {
  const auto folder = testing::test_data() / "led_points" / "DATA20100906_134124";
  if (!std::filesystem::exists(folder)) GTEST_SKIP() << "no captured detections at " << folder;
  SolveReport report;
  const ArrayModel model = solved_light(folder, report);
  std::string steps;
  for (const SolveReport::Step& step : report.steps) {
    steps += fmt::format("{}: {:.3f} px, {} of {} left out\n", step.what, step.rms_px,
                         step.outliers, step.outliers + step.observations);
  }
  SCOPED_TRACE(steps);
  const std::vector<double> errors = reprojection_errors(model);
  double sum = 0;
  for (const double error : errors) sum += error;
  EXPECT_LE(sum / static_cast<double>(errors.size()), 0.62);
  std::vector<std::size_t> seen(model.points.size(), 0), kept(model.points.size(), 0);
  for (const ArrayModel::Observation& observation : model.observations) {
    ++seen[observation.point];
    kept[observation.point] += model.counts(observation) ? 1 : 0;
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

/// Three cameras with narrow lenses. Two of them alone fit many different fields of view.
TEST(SolvedArrays, LensesThatNobodyGuessedAreFound) {
  const auto folder = testing::test_data() / "led_points" / "DATA20090709_111010";
  if (!std::filesystem::exists(folder)) GTEST_SKIP() << "no captured detections at " << folder;
  SolveReport report;
  const ArrayModel model = solved_light(folder, report);
  for (const ArrayModel::Camera& camera : model.cameras) EXPECT_TRUE(camera.pose) << camera.id;
  EXPECT_LE(rms_reprojection_error(model), 0.3);
  EXPECT_GE(report.steps.back().observations,
            0.98 * static_cast<double>(model.observations.size()));
}

}  // namespace
}  // namespace raystage::calibrate
