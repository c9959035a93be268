// SPDX-License-Identifier: Apache-2.0
#include "rig/planning/effective_resolution.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

namespace raystage::rig {
namespace {

constexpr double kDegree = std::numbers::pi / 180;

/// The example of thesis 5.3.5: cameras of 640 pixels and 60 degrees, views of 45 degrees.
CameraRow example() {
  return {.pixel_pitch = 2 * std::tan(30 * kDegree) / 640, .spacing = 0.05, .fov = 60 * kDegree};
}
RowView view_of(double rotation, double fov = 45) {
  return {.fov = fov * kDegree, .rotation = rotation * kDegree};
}

TEST(EffectiveResolution, HasTheValuesOfTheThesis) {
  const EffectiveResolution straight = effective_resolution(example(), view_of(0));
  EXPECT_EQ(std::lround(straight.never_oversampled), 459);
  EXPECT_EQ(std::lround(straight.never_undersampled), 459);
  EXPECT_EQ(straight.unrecorded_share, 0);
  EXPECT_NEAR(exact_sampling_pitch(example(), view_of(-15)), 0.002077, 5e-7);
  EXPECT_NEAR(exact_sampling_pitch(example(), view_of(15)), 0.001331, 5e-7);
  for (const double rotation : {-15.0, 15.0}) {
    const EffectiveResolution turned = effective_resolution(example(), view_of(rotation));
    EXPECT_EQ(std::lround(turned.never_oversampled), 399);
    EXPECT_EQ(std::lround(turned.never_undersampled), 622);
    // The cameras of the example see 60 degrees; 45 + 2 * 15 = 75 would be needed (eq. 6.1).
    EXPECT_NEAR(turned.unrecorded_share, 0.177, 5e-4);
  }
  CameraRow wide = example();
  wide.fov = 75 * kDegree;
  EXPECT_NEAR(effective_resolution(wide, view_of(15)).unrecorded_share, 0, 1e-12);
}

TEST(EffectiveResolution, ThePitchMakesTheFirstStepOnePixel) {
  std::mt19937 random(5);  // NOLINT: the same in every run
  std::uniform_real_distribution<double> unit(0, 1);
  for (int i = 0; i < 1000; ++i) {
    CameraRow row = example();
    row.focal_length = 0.1 + unit(random);
    row.pixel_pitch = row.focal_length * 0.01 * unit(random) + 1e-6;
    RowView view = view_of(60 * unit(random) - 30, 0.1 + 80 * unit(random));
    view.focal_length = 0.1 + unit(random);
    if (i % 2 == 1) {
      row.fixed_focal_distance = 3;
      view.depth = 2 * unit(random) - 1;
    }
    const double pitch = exact_sampling_pitch(row, view);
    EXPECT_NEAR(image_plane_step(row, view, pitch, 0) / row.pixel_pitch, 1, 1e-9) << i;
  }
}

// The definition of eq. 5.15: differences of the rays' slopes.
TEST(EffectiveResolution, StepsAreDifferencesOfSlopes) {
  const CameraRow row = example();
  for (const double rotation : {-20.0, 0.0, 7.0}) {
    const RowView view = view_of(rotation);
    const double pitch = 0.002, edge = std::tan(view.fov / 2);
    const auto slope = [&](int n) {
      // The ray of pixel n, turned by the rotation.
      const double x = -edge + n * pitch, sine = std::sin(view.rotation);
      const double cosine = std::cos(view.rotation);
      return (x * cosine - sine) / (x * sine + cosine);
    };
    for (const int n : {0, 100, 400}) {
      EXPECT_NEAR(image_plane_step(row, view, pitch, n), slope(n + 1) - slope(n), 1e-12);
    }
  }
}

TEST(EffectiveResolution, SpacingLimitsItFarFromTheArray) {
  // Thesis 5.3.3: 5.08 cm and 0.001804 of the focal length.
  CameraRow row{.pixel_pitch = 0.001804, .spacing = 0.0508, .fov = 60 * kDegree};
  EXPECT_NEAR(pixel_limited_depths(row).in_front, 28.16, 5e-3);
  EXPECT_NEAR(pixel_limited_depths(row).behind, -28.16, 5e-3);
  EXPECT_NEAR(epipolar_slope(row, 2), -2, 1e-12);
  EXPECT_NEAR(std::abs(epipolar_slope(row, pixel_limited_depths(row).in_front)),
              row.spacing / row.pixel_pitch, 1e-6);
  row.fixed_focal_distance = 40;
  for (const double depth :
       {pixel_limited_depths(row).in_front, pixel_limited_depths(row).behind}) {
    EXPECT_NEAR(std::abs(epipolar_slope(row, depth)), row.spacing / row.pixel_pitch, 1e-6);
  }
  EXPECT_LT(pixel_limited_depths(row).in_front, 28.16);
  row.fixed_focal_distance = 10;
  EXPECT_TRUE(std::isinf(pixel_limited_depths(row).behind));
  row.fixed_focal_distance = -10;  // diverging
  EXPECT_TRUE(std::isinf(pixel_limited_depths(row).in_front));
  EXPECT_LT(pixel_limited_depths(row).behind, 0);
}

TEST(EffectiveResolution, EndsWhereRaysDoNotCrossTheRow) {
  CameraRow row = example();
  EXPECT_EQ(exact_sampling_pitch(row, view_of(45, 100)), 0);
  EXPECT_TRUE(std::isinf(effective_resolution(row, view_of(45, 100)).never_undersampled));
  row.fixed_focal_distance = 4;
  for (const double rotation : {0.0, 15.0}) {
    RowView view = view_of(rotation);
    view.depth = 4;
    EXPECT_EQ(effective_resolution(row, view).never_oversampled, 0);
    EXPECT_EQ(effective_resolution(row, view).never_undersampled, 0);
    view.depth = 4 - 1e-3;  // steps of more than the view
    EXPECT_GE(effective_resolution(row, view).never_undersampled, 0);
  }
}

TEST(EffectiveResolution, OfSkewedCamerasFallsTowardsTheFocalPlane) {
  CameraRow row = example();
  row.fixed_focal_distance = 4;
  RowView view = view_of(0);
  EXPECT_NEAR(exact_sampling_pitch(row, view), row.pixel_pitch, 1e-15);
  view.depth = 2;  // eq. 5.22
  EXPECT_NEAR(exact_sampling_pitch(row, view), 2 * row.pixel_pitch, 1e-15);
  EXPECT_NEAR(effective_resolution(row, view).never_oversampled, 459 / 2.0, 0.5);
  view.depth = -4;
  EXPECT_NEAR(exact_sampling_pitch(row, view), row.pixel_pitch / 2, 1e-15);
}

}  // namespace
}  // namespace raystage::rig
