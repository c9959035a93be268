// SPDX-License-Identifier: Apache-2.0
// What is said to be uncertain is as uncertain as said: by many recordings of one array.
#include "rig/calibration/uncertainty.h"

#include <gtest/gtest.h>

#include <cmath>

#include "rig/calibration/calibration.h"
#include "rig/calibration/test_array.h"

namespace raystage {
namespace {

/// Sums of squares of what was wrong, and of what was said to be.
struct Squares {
  double wrong = 0, said = 0;
  double ratio() const { return std::sqrt(wrong / said); }
};

TEST(Deviations, AreAsLargeAsErrors) {
  Squares places, focal_lengths;
  constexpr int kRecordings = 14;
  for (int i = 0; i < kRecordings; ++i) {
    const SimulatedArray truth = simulated_array({.rows = 2,
                                                  .columns = 3,
                                                  .mounting_deg = 12,
                                                  .outliers = 0,
                                                  .seed = static_cast<unsigned>(100 + i)});
    CalibrationSettings settings;
    settings.solve.horizontal_fov = 60 * kTestDegree;
    Calibration found = calibrate(truth.detections, settings);
    ASSERT_TRUE(found.uncertainty);
    std::vector<Pose> poses;
    for (const ArrayModel::Camera& camera : found.model.cameras) poses.push_back(*camera.pose);
    const Similarity back = similarity_between(poses, truth.poses);
    for (std::size_t k = 0; k < poses.size(); ++k) {
      const Uncertainty::Camera& said = *found.uncertainty->cameras[k];
      places.wrong += (back(poses[k]).position - truth.poses[k].position).squaredNorm();
      places.said += (back.scale * said.place).squaredNorm();
    }
    const double off = found.model.cameras[0].intrinsics.fx - truth.lens.fx;
    focal_lengths.wrong += off * off;
    focal_lengths.said += std::pow(found.uncertainty->cameras[0]->lens[0], 2);
    EXPECT_NEAR(found.uncertainty->noise_px, 0.2, 0.04);
  }
  EXPECT_GE(places.ratio(), 0.7);
  EXPECT_LE(places.ratio(), 1.4);
  EXPECT_GE(focal_lengths.ratio(), 0.6);
  EXPECT_LE(focal_lengths.ratio(), 1.5);
}

TEST(Lenses, ThatRestStayEachAsItIs) {
  const SimulatedArray truth = simulated_array({.rows = 2, .columns = 2});
  CalibrationSettings settings;
  settings.solve.lenses.assign(4, truth.lens);
  settings.solve.lenses[1].fx = settings.solve.lenses[1].fy = 1.02 * truth.lens.fx;
  settings.solve.lens_is_known = true;
  const Calibration found = calibrate(truth.detections, settings);
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_EQ(found.model.cameras[i].intrinsics, settings.solve.lenses[i]) << i;
  }
}

TEST(Deviations, OfHeldPartsAreNone) {
  const SimulatedArray truth = simulated_array({.rows = 2, .columns = 2});
  CalibrationSettings settings;
  settings.solve.lenses.assign(4, truth.lens);
  settings.solve.lens_is_known = true;
  const Calibration found = calibrate(truth.detections, settings);
  BundleSettings free = found.solve.last;
  const auto all = uncertainty_of(found.model, free, {});
  ASSERT_TRUE(all);
  EXPECT_EQ(all->cameras[0]->lens, LensValues{});
  free.held_cameras = {true, true, false, false};
  const auto some = uncertainty_of(found.model, free, {});
  ASSERT_TRUE(some);
  EXPECT_FALSE(some->cameras[0]);
  EXPECT_GT(some->cameras[2]->place.norm(), 0);
  free.held_cameras.assign(4, true);
  EXPECT_FALSE(uncertainty_of(found.model, free, {}));
}

TEST(Deviations, OfWhatNothingTellsAreHuge) {
  // Cameras that all look the same way cannot tell a longer lens from a deeper scene.
  const SimulatedArray truth =
      simulated_array({.rows = 2, .columns = 3, .mounting_m = 0, .mounting_deg = 0});
  CalibrationSettings settings;
  settings.solve.horizontal_fov = 60 * kTestDegree;
  const Calibration found = calibrate(truth.detections, settings);
  ASSERT_TRUE(found.uncertainty);
  const Uncertainty::Direction& worst = found.uncertainty->weakest.front();
  EXPECT_GT(worst.deviation, 10);
  EXPECT_GT(worst.focal_length, 0.3);
}

}  // namespace
}  // namespace raystage
