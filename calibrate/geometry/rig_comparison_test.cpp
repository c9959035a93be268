// SPDX-License-Identifier: Apache-2.0
#include "calibrate/geometry/rig_comparison.h"

#include <gtest/gtest.h>

#include <cmath>

#include "base/error.h"
#include "calibrate/geometry/alignment.h"
#include "testing/calibrate/test_synthetic_array.h"

namespace raystage::calibrate {
namespace {

schemas::RigDocument grid_rig() {
  schemas::RigDocument rig;
  for (int i = 0; i < 9; ++i) {
    rig::Pose pose;
    const int row = i / 3, column = i % 3;
    pose.position = {0.06 * column, 0.06 * row, 0};
    schemas::RigDocument::Camera camera;
    camera.geometry = {fmt::format("c{}", i),       640, 480, {500, 500, 320, 240, {}},
                       rig::matrix_from_pose(pose), {},  {}};
    rig.cameras.push_back(camera);
  }
  return rig;
}

rig::Pose pose_of(const schemas::RigDocument::Camera& camera) {
  return rig::pose_from_matrix(camera.geometry.world_from_camera);
}

TEST(RigComparisons, ForgiveTheWorld) {
  const schemas::RigDocument rig = grid_rig();
  schemas::RigDocument moved = rig;
  SimilarityTransform away;
  away.rotation = Eigen::AngleAxisd(1, Eigen::Vector3d::UnitX()).toRotationMatrix();
  away.scale = 2.5;
  away.translation = {1, 2, 3};
  for (auto& camera : moved.cameras) {
    camera.geometry.world_from_camera = rig::matrix_from_pose(away(pose_of(camera)));
  }
  const RigComparison comparison = compare_rigs(rig, moved, 0);
  EXPECT_NEAR(comparison.scale, 1 / 2.5, 1e-12);
  for (const RigComparison::Camera& camera : comparison.cameras) {
    EXPECT_LE(camera.position_m, 1e-9);
    EXPECT_LE(camera.rotation_deg, 1e-5);
    EXPECT_LE(camera.max_px, 1e-6);
  }
}

TEST(RigComparisons, ForgiveTheTurnOfAPanoramicHead) {
  schemas::RigDocument head = grid_rig();
  head.cameras.resize(4);
  schemas::RigDocument turned = head;
  const auto around = [](double degrees) {
    return Eigen::AngleAxisd(degrees * testing::kTestDegree, Eigen::Vector3d::UnitY())
        .toRotationMatrix();
  };
  for (int i = 0; i < 4; ++i) {
    const auto set = [i](schemas::RigDocument& rig, const Eigen::Matrix3d& rotation) {
      rig.cameras[static_cast<std::size_t>(i)].geometry.world_from_camera =
          rig::matrix_from_pose({rotation, {1, 2, 3}});
    };
    set(head, around(90 * i));
    set(turned, around(90 * i + 30));
  }
  const RigComparison comparison = compare_rigs(head, turned, 0);
  EXPECT_EQ(comparison.scale, 1);
  for (const RigComparison::Camera& camera : comparison.cameras) {
    EXPECT_LE(camera.position_m, 1e-12);
    EXPECT_LE(camera.rotation_deg, 1e-5);
    EXPECT_LE(camera.max_px, 1e-6);
  }
}

TEST(RigComparisons, TellWhatMoved) {
  const schemas::RigDocument rig = grid_rig();
  schemas::RigDocument turned = rig;
  rig::Pose pose = pose_of(turned.cameras[4]);
  pose.world_from_camera_rotation =
      Eigen::AngleAxisd(testing::kTestDegree, Eigen::Vector3d::UnitY()).toRotationMatrix();
  turned.cameras[4].geometry.world_from_camera = rig::matrix_from_pose(pose);
  turned.cameras[8].geometry.intrinsics.fx *= 1.1;
  turned.cameras.back().geometry.id = "other";
  const RigComparison comparison = compare_rigs(rig, turned, 2);
  ASSERT_EQ(comparison.cameras.size(), 8U);
  EXPECT_EQ(comparison.only_in_first, std::vector<std::string>{"c8"});
  EXPECT_EQ(comparison.only_in_second, std::vector<std::string>{"other"});
  EXPECT_NEAR(comparison.cameras[4].rotation_deg, 1, 0.15);  // alignment spreads it
  EXPECT_NEAR(comparison.cameras[4].rms_px, 500 * std::tan(testing::kTestDegree), 2);
  EXPECT_LE(comparison.cameras[0].rotation_deg, 0.2);
  schemas::RigDocument one = rig;
  one.cameras.resize(1);
  EXPECT_THROW(compare_rigs(rig, one, 0), Error);
}

}  // namespace
}  // namespace raystage::calibrate
