// SPDX-License-Identifier: Apache-2.0
#include "render/common/plane_projection.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <limits>
#include <numbers>

#include "base/error.h"
#include "render/common/ray_cells.h"

namespace raystage::render {
namespace {

VirtualCamera random_view(double z) {
  rig::Pose pose;
  pose.position = {0.1, -0.2, z};
  pose.world_from_camera_rotation =
      Eigen::AngleAxisd(0.3, Eigen::Vector3d(0.2, 1, 0.1).normalized()).toRotationMatrix();
  return virtual_camera_with_fov(320, 240, 1, pose);
}

rig::Pose some_camera() {
  rig::Pose pose;
  pose.position = {-0.05, 0.07, 0.01};
  pose.world_from_camera_rotation =
      Eigen::AngleAxisd(-0.1, Eigen::Vector3d(1, 0.4, 0).normalized()).toRotationMatrix();
  return pose;
}

TEST(PlaneProjection, HomographyEqualsIntersectionThenProjection) {
  for (const Eigen::Vector4d& plane :
       {Eigen::Vector4d(0, 0, 1, 4), Eigen::Vector4d(0, 0, -2, -8),
        Eigen::Vector4d(0.3, -0.2, 1, 3), Eigen::Vector4d(0, 0, 1, 1e9),
        Eigen::Vector4d(0, 1, 0.2, 5)}) {
    const VirtualCamera view = random_view(0.2);
    const PlaneProjection projection(view, plane);
    const rig::Pose camera = some_camera();
    const Eigen::Matrix3d ideal_from_pixel = projection.ideal_from_pixel(camera);
    for (const auto& [x, y] : {std::pair{0.5, 0.5}, {160.0, 120.0}, {319.5, 7.25}}) {
      const Eigen::Vector3d ray = world_ray_from_pixel(view) * Eigen::Vector3d(x, y, 1);
      const double t =
          -(plane.head<3>().dot(view.pose.position) + plane.w()) / plane.head<3>().dot(ray);
      if (t <= 0) {
        EXPECT_EQ(projection.depth(x, y), 0);
        continue;
      }
      EXPECT_NEAR(projection.depth(x, y) / t, 1, 1e-9);
      const Eigen::Vector3d in_camera = camera.camera_from_world(view.pose.position + t * ray);
      const Eigen::Vector3d ideal = ideal_from_pixel * Eigen::Vector3d(x, y, 1);
      ASSERT_GT(ideal.z(), 0);
      EXPECT_NEAR(ideal.x() / ideal.z(), in_camera.x() / -in_camera.z(), 1e-9);
      EXPECT_NEAR(ideal.y() / ideal.z(), in_camera.y() / in_camera.z(), 1e-9);
    }
  }
}

TEST(PlaneProjection, AtInfinityOnlyDirectionsCount) {
  const VirtualCamera view = random_view(0.2);
  const PlaneProjection projection(view, {0, 0, 0, 1});
  EXPECT_EQ(projection.depth(3, 4), std::numeric_limits<double>::infinity());
  const rig::Pose camera = some_camera();
  const Eigen::Vector3d ray = camera.world_from_camera_rotation.transpose() *
                              (world_ray_from_pixel(view) * Eigen::Vector3d(3, 4, 1));
  const Eigen::Vector3d ideal = projection.ideal_from_pixel(camera) * Eigen::Vector3d(3, 4, 1);
  EXPECT_NEAR(ideal.x() / ideal.z(), ray.x() / -ray.z(), 1e-12);
}

TEST(PlaneProjection, RefusesWhatIsNoPlane) {
  EXPECT_THROW(PlaneProjection(random_view(0), {0, 0, 0, 0}), Error);
  EXPECT_THROW(PlaneProjection(random_view(0), {0, std::nan(""), 1, 0}), Error);
}

}  // namespace
}  // namespace raystage::render
