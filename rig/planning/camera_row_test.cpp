// SPDX-License-Identifier: Apache-2.0
#include "rig/planning/camera_row.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>

#include "base/error.h"

namespace raystage::rig {
namespace {

constexpr double kPerDegree = std::numbers::pi / 180;

/// Cameras of 320 x 240 pixels and 62 degrees, 60 mm apart (the prototype of thesis chapter 4).
/// `toe_in`: radians per metre; `fixed_distance`: of the plane of skewed cameras; 0: not skewed.
Rig prototype(double toe_in = 0, double fixed_distance = 0) {
  Rig rig;
  for (int row = 0; row < 8; ++row) {
    for (int column = 0; column < 8; ++column) {
      const double x = 0.06 * (column - 3.5), y = 0.06 * (row - 3.5);
      schemas::CameraGeometry geometry;
      geometry.id = "c" + std::to_string(rig.cameras.size());
      geometry.width = 320;
      geometry.height = 240;
      const double focal = 160 / std::tan(31 * kPerDegree);
      geometry.intrinsics = {focal, focal, 160, 120, {}};
      if (fixed_distance > 0) geometry.intrinsics.cx += focal * x / fixed_distance;
      Pose pose;
      pose.position = {x, y, 0};
      pose.world_from_camera_rotation =
          Eigen::AngleAxisd(toe_in * x, Eigen::Vector3d::UnitY()).toRotationMatrix();
      rig.cameras.push_back({geometry.id, CameraModel(geometry), pose, {}, row, column});
    }
  }
  return rig;
}

TEST(ArraySampling, OfParallelCamerasIsThatOfOne) {
  const ArraySampling sampling = measure_sampling(prototype(), ArrayAxis::kHorizontal);
  EXPECT_NEAR(sampling.row.pixel_pitch, 0.0037554, 5e-8);
  EXPECT_NEAR(sampling.row.fov, 62 * kPerDegree, 1e-12);
  EXPECT_NEAR(sampling.row.spacing, 0.06, 1e-12);
  EXPECT_NEAR(sampling.width, 0.42, 1e-12);
  EXPECT_EQ(sampling.pixels, 320);
  EXPECT_NEAR(sampling.max_rotation, 0, 1e-12);
  EXPECT_NEAR(sampling.finest_step, sampling.row.pixel_pitch, 1e-12);
  EXPECT_NEAR(sampling.coarsest_step, sampling.row.pixel_pitch, 1e-12);
  EXPECT_FALSE(sampling.is_skewed);
  EXPECT_EQ(measure_sampling(prototype(), ArrayAxis::kVertical).pixels, 240);
}

TEST(ArraySampling, FindsThePlaneOfSkewedCameras) {
  const ArraySampling sampling = measure_sampling(prototype(0, 4), ArrayAxis::kHorizontal);
  EXPECT_TRUE(sampling.is_skewed);
  EXPECT_NEAR(sampling.row.fixed_focal_distance, 4, 1e-9);
  EXPECT_FALSE(measure_sampling(prototype(0, 4), ArrayAxis::kVertical).is_skewed);
  // Principal points that scatter are no skew.
  Rig scattered = prototype();
  schemas::CameraGeometry geometry;
  geometry.width = 320;
  geometry.height = 240;
  geometry.intrinsics = scattered.cameras[0].model.intrinsics();
  geometry.intrinsics.cx += 5;
  scattered.cameras[3].model = CameraModel(geometry);
  EXPECT_FALSE(measure_sampling(scattered, ArrayAxis::kHorizontal).is_skewed);
}

// A camera at x = 0.21 turned by r towards the middle: its rays have the slopes tan(r + a).
TEST(ArraySampling, OfRotatedCamerasIsUneven) {
  const ArraySampling sampling = measure_sampling(prototype(1), ArrayAxis::kHorizontal);
  EXPECT_NEAR(sampling.max_rotation, 0.21, 1e-9);
  const double edge = 31 * kPerDegree, pitch = 2 * std::tan(edge) / 320;
  const double inner = std::atan(std::tan(edge) - pitch);
  EXPECT_NEAR(sampling.coarsest_step, std::tan(0.21 + edge) - std::tan(0.21 + inner), 1e-9);
  EXPECT_LT(sampling.finest_step, pitch);
  EXPECT_GT(sampling.coarsest_step, 1.5 * sampling.finest_step);
}

TEST(ArraySampling, OfNoCameraIsRefused) {
  EXPECT_THROW(measure_sampling(Rig(), ArrayAxis::kHorizontal), Error);
}

}  // namespace
}  // namespace raystage::rig
