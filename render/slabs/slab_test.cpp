// SPDX-License-Identifier: Apache-2.0
#include "render/slabs/slab.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <numbers>
#include <numeric>
#include <random>

#include "testing/render/synthetic_take.h"

namespace raystage::render::slab_test {
namespace {

using Eigen::Vector3d;

constexpr double kDegree = std::numbers::pi / 180;

rig::Rig rig_of(const std::vector<schemas::CameraGeometry>& cameras) {
  schemas::RigDocument document;
  for (const schemas::CameraGeometry& camera : cameras) document.cameras.push_back({camera, {}});
  return rig::rig_from_document(document);
}

std::vector<Slab> fit(const rig::Rig& rig, const SlabOptions& options = {}) {
  std::vector<int> all(rig.cameras.size());
  std::iota(all.begin(), all.end(), 0);
  return fit_slabs(rig, all, rig::make_topology(rig, all).normal, options);
}

void turn(schemas::CameraGeometry& camera, const Eigen::Matrix3d& rotation) {
  rig::Pose pose = rig::pose_from_matrix(camera.world_from_camera);
  pose.world_from_camera_rotation = rotation * pose.world_from_camera_rotation;
  camera.world_from_camera = rig::matrix_from_pose(pose);
}

TEST(FitSlabs, AWallEyedGridIsItsOwnSlab) {
  std::vector<schemas::CameraGeometry> cameras = testing::camera_grid(3, 5, 0.06, 160, 120);
  for (schemas::CameraGeometry& camera : cameras) camera.intrinsics.cx += 3.25;
  for (const double offset : {0.0, 1e7}) {
    for (schemas::CameraGeometry& camera : cameras) camera.world_from_camera[11] = offset;
    const rig::Rig rig = rig_of(cameras);
    const std::vector<Slab> slabs = fit(rig);
    ASSERT_EQ(slabs.size(), 1U);
    const Slab& slab = slabs[0];
    EXPECT_EQ(slab.columns, 5);
    EXPECT_EQ(slab.rows, 3);
    EXPECT_NEAR(slab.column_spacing, 0.06, 1e-12);
    EXPECT_TRUE(slab.pose.world_from_camera_rotation.isApprox(Eigen::Matrix3d::Identity(), 1e-9));
    for (const schemas::CameraGeometry& camera : cameras) {
      const Vector3d node = slab.node_position(*camera.column, *camera.row);
      EXPECT_LT((node - rig::pose_from_matrix(camera.world_from_camera).position).norm(),
                1e-9 + 1e-15 * offset);
    }
    EXPECT_EQ(slab.width, 160);
    EXPECT_EQ(slab.height, 120);
    EXPECT_NEAR(slab.image.fx, cameras[0].intrinsics.fx, 1e-6);
    EXPECT_NEAR(slab.image.cx, cameras[0].intrinsics.cx, 1e-9);
    EXPECT_NEAR(slab.image.cy, cameras[0].intrinsics.cy, 1e-9);
  }
}

TEST(FitSlabs, ARolledGridKeepsItsColumns) {
  std::vector<schemas::CameraGeometry> cameras = testing::camera_grid(2, 3, 0.06, 160, 120);
  const Eigen::Matrix3d roll(Eigen::AngleAxisd(0.3, Vector3d::UnitZ()));
  for (schemas::CameraGeometry& camera : cameras) {
    rig::Pose pose = rig::pose_from_matrix(camera.world_from_camera);
    pose.position = roll * pose.position;
    camera.world_from_camera = rig::matrix_from_pose(pose);
    turn(camera, roll);
  }
  const Slab slab = fit(rig_of(cameras))[0];
  EXPECT_TRUE(slab.pose.world_from_camera_rotation.isApprox(roll, 1e-9));
  EXPECT_EQ(slab.columns, 3);
  EXPECT_EQ(slab.rows, 2);
}

TEST(FitSlabs, TheImagePlaneHoldsAndResolvesWhatEveryCameraSees) {
  std::vector<schemas::CameraGeometry> cameras =
      testing::camera_grid(2, 4, 0.1, 200, 150, {-0.2, 0.04, 0, 0, 0});
  for (schemas::CameraGeometry& camera : cameras) {  // toed in
    turn(camera, Eigen::AngleAxisd((*camera.column - 1.5) * 8 * kDegree, Vector3d::UnitY())
                     .toRotationMatrix());
  }
  const rig::Rig rig = rig_of(cameras);
  const Slab slab = fit(rig)[0];
  const auto sample_of = [&](const rig::Rig::Camera& camera, double x, double y) {
    const Vector3d ray = slab.pose.world_from_camera_rotation.transpose() *
                         camera.pose.world_from_camera_rotation * *camera.model.unproject({x, y});
    return Eigen::Vector2d(slab.image.fx * ray.x() / -ray.z() + slab.image.cx,
                           slab.image.fy * ray.y() / ray.z() + slab.image.cy);
  };
  for (const rig::Rig::Camera& camera : rig.cameras) {
    for (double y = 0; y <= 150; y += 7.5) {
      for (double x = 0; x <= 199; x += 10) {
        const Eigen::Vector2d sample = sample_of(camera, x, y);
        ASSERT_GT(sample.minCoeff(), -0.5);
        ASSERT_LT(sample.x(), slab.width + 0.5);
        ASSERT_LT(sample.y(), slab.height + 0.5);
        ASSERT_GT((sample_of(camera, x + 1, y) - sample).norm(), 0.98);  // one pixel is one sample
      }
    }
  }
  EXPECT_LT(slab.width, 400);
}

TEST(FitSlabs, CamerasAnywhereGetAGridAsDenseAsTheyAre) {
  std::vector<schemas::CameraGeometry> cameras = testing::camera_grid(6, 6, 0.1, 80, 60);
  std::mt19937 random(3);
  std::uniform_real_distribution<double> anywhere(-0.03, 0.03);
  for (schemas::CameraGeometry& camera : cameras) {
    camera.row.reset();
    camera.column.reset();
    camera.world_from_camera[3] += anywhere(random);
    camera.world_from_camera[7] += anywhere(random);
  }
  const rig::Rig rig = rig_of(cameras);
  const Slab slab = fit(rig)[0];
  EXPECT_GE(slab.columns, 6);
  EXPECT_LE(slab.columns, 12);
  double least = 1, most = -1;
  for (const rig::Rig::Camera& camera : rig.cameras) {
    const Vector3d c = slab.pose.camera_from_world(camera.pose.position);
    least = std::min(least, c.x());
    most = std::max(most, c.x());
  }
  EXPECT_NEAR(least, 0, 1e-9);
  EXPECT_NEAR(most, slab.column_spacing * (slab.columns - 1), 1e-9);
  SlabOptions options;
  options.columns = 9;
  options.rows = 1;
  options.uv_scale = 0.5;
  const Slab asked = fit(rig, options)[0];
  EXPECT_EQ(asked.columns, 9);
  EXPECT_EQ(asked.rows, 1);
  EXPECT_NEAR(asked.width, slab.width / 2.0, 1.01);
}

TEST(FitSlabs, LinesAndSingleCameras) {
  for (const auto& [rows, columns] : {std::pair{1, 1}, {1, 4}, {4, 1}}) {
    const Slab slab = fit(rig_of(testing::camera_grid(rows, columns, 0.06, 40, 30)))[0];
    EXPECT_EQ(slab.rows, rows);
    EXPECT_EQ(slab.columns, columns);
    EXPECT_EQ(slab.width, 40);
  }
}

TEST(FitSlabs, ABoxHasASideForEveryDirection) {
  const Eigen::Matrix3d tilt =
      (Eigen::AngleAxisd(0.3, Vector3d::UnitX()) * Eigen::AngleAxisd(0.2, Vector3d::UnitY()))
          .toRotationMatrix();
  std::vector<schemas::CameraGeometry> cameras;
  const auto add_side = [&](const Eigen::Matrix3d& side) {
    for (schemas::CameraGeometry camera : testing::camera_grid(2, 2, 0.2, 60, 60)) {
      rig::Pose pose = rig::pose_from_matrix(camera.world_from_camera);
      pose.position = tilt * side * (pose.position - Vector3d(0, 0, 0.3));
      camera.world_from_camera = rig::matrix_from_pose(pose);
      turn(camera, tilt * side);
      camera.id += std::to_string(cameras.size());
      cameras.push_back(camera);
    }
  };
  for (int quarter = 0; quarter < 4; ++quarter) {
    add_side(Eigen::AngleAxisd(quarter * 90 * kDegree, Vector3d::UnitY()).toRotationMatrix());
  }
  add_side(Eigen::AngleAxisd(90 * kDegree, Vector3d::UnitX()).toRotationMatrix());
  SlabOptions options;
  options.layout = SlabOptions::Layout::kBox;
  const rig::Rig rig = rig_of(cameras);
  const std::vector<Slab> slabs = fit(rig, options);
  ASSERT_EQ(slabs.size(), 5U);  // no camera looks down
  for (const Slab& slab : slabs) {
    ASSERT_EQ(slab.cameras.size(), 4U);
    EXPECT_EQ(slab.nodes(), 4);
    EXPECT_EQ(slab.competing_axes.size(), 5U);
    for (const int camera : slab.cameras) {
      EXPECT_GT(rig.cameras[camera].pose.viewing_direction().dot(slab.pose.viewing_direction()),
                0.9999);
    }
    for (const Vector3d& rival : slab.competing_axes) {
      EXPECT_LT(rival.dot(slab.pose.viewing_direction()), 1e-9);
    }
  }
}

}  // namespace
}  // namespace raystage::render::slab_test
