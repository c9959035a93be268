// SPDX-License-Identifier: Apache-2.0
#include "compose/layers/view_coverage.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace raystage::compose {
namespace {

constexpr double kDegrees = std::numbers::pi / 180;

/// Returns 3 cameras 0.1 m apart along x, with a full angle of 90 degrees, that look along -z.
rig::Rig row_of_cameras() {
  rig::Rig rig;
  for (int i = 0; i < 3; ++i) {
    schemas::CameraGeometry geometry;
    geometry.id = "c" + std::to_string(i);
    geometry.width = geometry.height = 100;
    geometry.intrinsics = {50, 50, 50, 50, {}};
    rig::Pose pose;
    pose.position.x() = 0.1 * (i - 1);
    rig.cameras.push_back({geometry.id, rig::CameraModel(geometry), pose, {}, {}, {}});
  }
  return rig;
}

/// Returns a view of a full angle, turned to the left about the y axis; degrees.
render::VirtualCamera view_of(double angle, double turned) {
  const double focal = 50 / std::tan(angle / 2 * kDegrees);
  render::VirtualCamera view{100, 100, {focal, focal, 50, 50, {}}, {}};
  view.pose.world_from_camera_rotation =
      Eigen::AngleAxisd(turned * kDegrees, Eigen::Vector3d::UnitY()).toRotationMatrix();
  return view;
}

TEST(ViewCoverage, IsWholeWithinTheAnglesOfTheCameras) {
  EXPECT_EQ(uncovered_ray_share(row_of_cameras(), view_of(80, 0), schemas::DepthRange{1, 20}), 0);
  EXPECT_EQ(uncovered_ray_share(row_of_cameras(), view_of(80, 0), std::nullopt), 0);
}

TEST(ViewCoverage, IsTheShareOfTheAngleThatTheCamerasSee) {
  // The tangent of 45 degrees of that of the view's 60: a third of 42 % squared, far away.
  const double seen = 1 / std::tan(60 * kDegrees);
  const double far =
      uncovered_ray_share(row_of_cameras(), view_of(120, 0), schemas::DepthRange{1000, 2000});
  EXPECT_NEAR(far, 1 - seen * seen, 0.04);
}

TEST(ViewCoverage, IsNothingWhereNoCameraLooks) {
  EXPECT_EQ(uncovered_ray_share(row_of_cameras(), view_of(40, 180), std::nullopt), 1);
  EXPECT_EQ(uncovered_ray_share(row_of_cameras(), view_of(40, 70), schemas::DepthRange{5, 50}), 1);
  EXPECT_NEAR(uncovered_ray_share(row_of_cameras(), view_of(40, 45), schemas::DepthRange{500, 900}),
              0.5, 0.1);
}

}  // namespace
}  // namespace raystage::compose
