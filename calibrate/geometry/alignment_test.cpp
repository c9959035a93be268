// SPDX-License-Identifier: Apache-2.0
#include "calibrate/geometry/alignment.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <random>

namespace raystage::calibrate {
namespace {

using Eigen::Vector3d;

Eigen::Matrix3d some_turn(std::mt19937& random) {
  std::normal_distribution<double> normal;
  return Eigen::Quaterniond(normal(random), normal(random), normal(random), normal(random))
      .normalized()
      .toRotationMatrix();
}

void expect_brought_back(const std::vector<rig::Pose>& poses, std::mt19937& random) {
  std::normal_distribution<double> normal;
  SimilarityTransform moved;
  moved.rotation = some_turn(random);
  moved.scale = std::exp(3 * normal(random));
  moved.translation = 100 * Vector3d(normal(random), normal(random), normal(random));
  std::vector<rig::Pose> elsewhere;
  for (const rig::Pose& pose : poses) elsewhere.push_back(moved(pose));
  const SimilarityTransform back = estimate_similarity(elsewhere, poses);
  EXPECT_NEAR(back.scale * moved.scale, 1, 1e-9);
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const rig::Pose again = back(elsewhere[i]);
    EXPECT_LT((again.position - poses[i].position).norm(), 1e-8);
    EXPECT_LT((again.world_from_camera_rotation - poses[i].world_from_camera_rotation).norm(),
              1e-8);
  }
}

TEST(Alignment, BringsAnyArrayBack) {
  std::mt19937 random(5);
  std::normal_distribution<double> normal;
  for (int i = 0; i < 50; ++i) {
    std::vector<rig::Pose> poses;
    for (int camera = 0; camera < 6; ++camera) {
      poses.push_back({some_turn(random), {normal(random), normal(random), normal(random)}});
    }
    expect_brought_back(poses, random);
    // Cameras in a plane, on a line, and only two: rotations complete the alignment.
    for (rig::Pose& pose : poses) pose.position.z() = 0;
    expect_brought_back(poses, random);
    for (rig::Pose& pose : poses) pose.position.y() = 0;
    expect_brought_back(poses, random);
    poses.resize(2);
    expect_brought_back(poses, random);
  }
}

TEST(Alignment, DirectionsAlignCentresInOnePlace) {
  std::mt19937 random(6);
  // The mean of seven such centres is rounded; one array has a spread, the other none.
  for (const double spread : {0.0, 0.1}) {
    std::vector<rig::Pose> from, to;
    const Eigen::Matrix3d turn = some_turn(random);
    for (int camera = 0; camera < 7; ++camera) {
      from.push_back({some_turn(random), {0.1, 0.2 + spread * camera, 5e6 / 3}});
      to.push_back({turn * from.back().world_from_camera_rotation, {0.7, 0.1, -0.3}});
    }
    const SimilarityTransform found = estimate_similarity(from, to);
    EXPECT_LT((found.rotation - turn).norm(), 1e-12);
    EXPECT_EQ(found.scale, 1);
    EXPECT_LT((found(from[3].position) - to[3].position).norm(), 1e-8);
  }
}

TEST(Alignment, MovesAllThatIsFound) {
  ArrayModel model;
  model.cameras.resize(2);
  model.cameras[0].pose = rig::Pose{Eigen::Matrix3d::Identity(), {1, 2, 3}};
  model.points = {Vector3d(0, 0, -1), std::nullopt};
  SimilarityTransform twice;
  twice.scale = 2;
  twice.translation = {1, 0, 0};
  apply(twice, model);
  EXPECT_EQ(model.cameras[0].pose->position, Vector3d(3, 4, 6));
  EXPECT_FALSE(model.cameras[1].pose);
  EXPECT_EQ(*model.points[0], Vector3d(1, 0, -2));
  EXPECT_FALSE(model.points[1]);
}

}  // namespace
}  // namespace raystage::calibrate
