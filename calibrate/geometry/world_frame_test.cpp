// SPDX-License-Identifier: Apache-2.0
#include "calibrate/geometry/world_frame.h"

#include <gtest/gtest.h>

#include "base/error.h"
#include "testing/calibrate/test_synthetic_array.h"

namespace raystage::calibrate {
namespace {

using Eigen::Vector3d;

/// Returns a grid of cameras that look along -z, transformed as a whole by `away`.
ArrayModel strange_grid(int rows, int columns, const SimilarityTransform& away) {
  ArrayModel model;
  for (int i = 0; i < rows * columns; ++i) {
    rig::Pose pose;
    const int row = i / columns, column = i % columns;
    pose.position = Vector3d(0.06 * column, -0.05 * row, 0.001 * (i % 3));
    model.cameras.push_back({fmt::format("c{}", i), 640, 480, {}, away(pose)});
  }
  return model;
}

SimilarityTransform somewhere() {
  SimilarityTransform away;
  away.rotation = Eigen::AngleAxisd(2.4, Vector3d(0.3, -0.8, 0.5).normalized()).toRotationMatrix();
  away.scale = 17;
  away.translation = {3, -40, 12};
  return away;
}

TEST(WorldFrames, AreTheArraysOwn) {
  ArrayModel model = strange_grid(4, 6, somewhere());
  align_to_array(model);
  ASSERT_TRUE(scale_world(model, {.distance = ScaleOptions::Distance{"c0", "c1", 0.06}}));
  Vector3d middle = Vector3d::Zero();
  for (int i = 0; i < 24; ++i) {
    const rig::Pose& pose = *model.cameras[i].pose;
    middle += pose.position / 24;
    const int row = i / 6, column = i % 6;
    const Vector3d expected(0.06 * (column - 2.5), -0.05 * (row - 1.5), 0);
    EXPECT_LE((pose.position - expected).norm(), 0.003) << i;
    EXPECT_GE(pose.viewing_direction().dot(Vector3d(0, 0, -1)), 0.999);
    EXPECT_GE(pose.world_from_camera_rotation.col(1).y(), 0.999);
  }
  EXPECT_LE(middle.norm(), 1e-9);
  const auto places = find_grid_positions(model);
  ASSERT_TRUE(places);
  for (int i = 0; i < 24; ++i) {
    EXPECT_EQ((*places)[i], (GridPosition{i / 6, i % 6}));
  }
  EXPECT_NEAR(camera_spacing(model), 0.055, 0.001);
}

TEST(WorldFrames, SpacingTellsTheScale) {
  ArrayModel model = strange_grid(4, 6, somewhere());
  EXPECT_FALSE(scale_world(model, {}));
  align_to_array(model);
  ASSERT_TRUE(scale_world(model, {.spacing_m = 0.055}));
  const Vector3d step = model.cameras[1].pose->position - model.cameras[0].pose->position;
  EXPECT_NEAR(step.norm(), 0.06, 1e-3);
}

TEST(WorldFrames, ALineOfCamerasHasARowOnly) {
  for (const int rows : {1, 5}) {
    ArrayModel model = strange_grid(rows, 6 - rows, somewhere());
    align_to_array(model);
    const Vector3d along = (model.cameras.back().pose->position -  // to the right, or down
                            model.cameras.front().pose->position)
                               .normalized();
    EXPECT_GE(along.dot(rows == 1 ? Vector3d(1, 0, 0) : Vector3d(0, -1, 0)), 0.999);
    for (const ArrayModel::Camera& camera : model.cameras) {
      EXPECT_GE(camera.pose->viewing_direction().dot(Vector3d(0, 0, -1)), 0.99);
    }
    EXPECT_TRUE(find_grid_positions(model));
  }
}

TEST(WorldFrames, CamerasAllAroundHaveNoGrid) {
  ArrayModel model;
  for (int i = 0; i < 7; ++i) {
    const double angle = i * 2 * std::numbers::pi / 7;
    rig::Pose pose;
    pose.world_from_camera_rotation =
        Eigen::AngleAxisd(angle, Vector3d::UnitY()).toRotationMatrix();
    pose.position = pose.world_from_camera_rotation * Vector3d(0, 0, 2);
    model.cameras.push_back({fmt::format("c{}", i), 640, 480, {}, somewhere()(pose)});
  }
  align_to_array(model);
  EXPECT_FALSE(find_grid_positions(model));
  for (const ArrayModel::Camera& camera : model.cameras) {
    EXPECT_GE(camera.pose->world_from_camera_rotation.col(1).y(), 0.999);
  }
}

TEST(WorldFrames, DistancesAreBetweenCamerasThatExist) {
  ArrayModel model = strange_grid(2, 2, {});
  const auto between = [](const char* from, const char* to) {
    return ScaleOptions{.distance = ScaleOptions::Distance{from, to, 1}};
  };
  EXPECT_THROW(scale_world(model, between("c0", "c9")), Error);
  EXPECT_THROW(scale_world(model, between("c0", "c0")), Error);
  model.cameras[1].pose.reset();
  EXPECT_THROW(scale_world(model, between("c0", "c1")), Error);
  EXPECT_TRUE(scale_world(model, between("c0", "c2")));
}

}  // namespace
}  // namespace raystage::calibrate
