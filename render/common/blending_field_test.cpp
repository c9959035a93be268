// SPDX-License-Identifier: Apache-2.0
#include "render/common/blending_field.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <map>
#include <numbers>
#include <numeric>

namespace raystage::render {
namespace {

/// Returns `size` x `size` wall-eyed cameras 0.1 m apart, 60 degrees wide, around the origin.
rig::Rig grid(int size) {
  rig::Rig rig;
  schemas::CameraGeometry geometry;
  geometry.id = "c";
  geometry.width = 320;
  geometry.height = 240;
  geometry.intrinsics = {277, 277, 160, 120, {}};
  for (int row = 0; row < size; ++row) {
    for (int column = 0; column < size; ++column) {
      rig::Pose pose;
      pose.position = {0.1 * (column - (size - 1) / 2.0), 0.1 * (row - (size - 1) / 2.0), 0};
      rig.cameras.push_back({"c", rig::CameraModel(geometry), pose, {}, {}, {}});
    }
  }
  return rig;
}

std::vector<int> all(const rig::Rig& rig) {
  std::vector<int> members(rig.cameras.size());
  std::iota(members.begin(), members.end(), 0);
  return members;
}

VirtualCamera view_from(const Eigen::Vector3d& position, double fov = 0.8) {
  rig::Pose pose;
  pose.position = position;
  return virtual_camera_with_fov(200, 150, fov, pose);
}

std::map<int, double> shares_at(const BlendingField& field, int x, int y) {
  const auto& tile = field.tile(x / BlendingField::kTile, y / BlendingField::kTile);
  std::map<int, double> weights;
  for (const auto& camera : tile.cameras) {
    weights[camera.camera] = static_cast<double>(BlendingField::share(tile, camera, x, y));
  }
  return weights;
}

TEST(BlendingField, SharesSumToOneAndDoNotJump) {
  const rig::Rig rig = grid(6);
  const VirtualCamera view = view_from({0.013, -0.02, 0.4});
  const BlendingField field(view, rig, all(rig), {0.125, 0.375}, 4);
  double most = 0;
  for (int y = 0; y < view.height; ++y) {
    std::map<int, double> before;
    for (int x = 0; x < view.width; ++x) {
      const auto weights = shares_at(field, x, y);
      double sum = 0;
      for (const auto& [camera, share] : weights) {
        EXPECT_GE(share, 0);
        sum += share;
        if (x > 0) {
          const double last = before.contains(camera) ? before[camera] : 0;
          most = std::max(most, std::abs(share - last));
        }
      }
      EXPECT_NEAR(sum, 1, 1e-5);
      before = weights;
    }
  }
  EXPECT_LT(most, 2.0 / BlendingField::kTile);
  EXPECT_GT(most, 0);
}

TEST(BlendingField, SharesDoNotJumpAsTheViewMoves) {
  const rig::Rig rig = grid(4);
  std::map<int, double> before;
  double most = 0;
  for (int i = 0; i <= 2000; ++i) {  // past several cameras, a tenth of a millimetre at a time
    const VirtualCamera view = view_from({-0.1 + 0.0001 * i, 0.021, 0});
    auto weights = shares_at(BlendingField(view, rig, all(rig), {0.125, 0.375}, 4), 100, 75);
    for (auto& [camera, share] : weights) {
      if (i > 0) most = std::max(most, std::abs(share - before[camera]));
    }
    before = weights;
  }
  EXPECT_LT(most, 0.05);
}

TEST(BlendingField, ACameraAtTheEyeTakesNearlyAll) {
  const rig::Rig rig = grid(4);
  const VirtualCamera view = view_from(rig.cameras[5].pose.position);
  EXPECT_GT(shares_at(BlendingField(view, rig, all(rig), {0.125, 0.375}, 4), 100, 75).at(5), 0.95);
}

TEST(BlendingField, CamerasThatDoNotSeeAreNotChosen) {
  rig::Rig rig = grid(2);
  rig.cameras[0].pose.world_from_camera_rotation.col(0) *= -1;  // rotated backwards
  rig.cameras[0].pose.world_from_camera_rotation.col(2) *= -1;
  const BlendingField field(view_from({0, 0, 0}), rig, all(rig), {0.125, 0.375}, 4);
  const auto weights = shares_at(field, 100, 75);
  EXPECT_FALSE(weights.contains(0));
  EXPECT_EQ(weights.size(), 3);
  const BlendingField away(view_from({0, 0, -5}, 2.9), rig, {1}, {0.125, 0.375},
                           4);  // sees past its frame
  EXPECT_TRUE(away.tile(0, 0).cameras.empty());
}

TEST(SweepPlanes, RangeOfAViewIsTheSceneMeasuredFromTheEye) {
  const rig::Rig rig = grid(3);
  const double infinity = std::numeric_limits<double>::infinity();
  const auto range = [&](const VirtualCamera& view, schemas::DepthRange scene) {
    return inverse_depth_range_in_view(view, rig, scene);
  };
  const auto plain = range(view_from({0, 0, 0}), {2, 8});
  EXPECT_NEAR(plain.nearest, 0.5, 1e-12);
  EXPECT_NEAR(plain.farthest, 0.125, 1e-12);
  EXPECT_NEAR(range(view_from({0, 0, 1}), {2, infinity}).nearest, 1.0 / 3, 1e-12);
  EXPECT_EQ(range(view_from({0, 0, 1}), {2, infinity}).farthest, 0);
  const auto inside = range(view_from({0, 0, -3}), {2, 8});
  EXPECT_NEAR(inside.farthest, 0.2, 1e-12);
  EXPECT_NEAR(inside.nearest, 2, 1e-12);  // a quarter of near
  EXPECT_TRUE(range(view_from({0, 0, -9}), {2, 8}).empty());
  VirtualCamera back = view_from({0, 0, -9});
  back.pose.world_from_camera_rotation.col(0) *= -1;
  back.pose.world_from_camera_rotation.col(2) *= -1;
  EXPECT_NEAR(range(back, {2, 8}).nearest, 1, 1e-12);
  EXPECT_NEAR(range(back, {2, 8}).farthest, 1.0 / 7, 1e-12);
}

TEST(SweepPlanes, AreAsManyAsDisparityAsksFor) {
  const rig::Rig rig = grid(3);
  const VirtualCamera view = view_from({0.05, 0.05, 0});
  const auto planes = [&](schemas::DepthRange scene, double step_px,
                          const std::vector<int>& members) {
    const auto range = inverse_depth_range_in_view(view, rig, scene);
    const BlendingField field(view, rig, members, range, 4);
    return required_plane_count(range, view, rig, field, step_px);
  };
  // Neighbours 0.1 m apart, focal length 277: eq. 2.1's disparity from 2 to 8 m is 10.4 pixels in
  // the middle of a frame.
  const double found = planes({2, 8}, 0.5, all(rig));
  EXPECT_NEAR(found, 1 + 277 * 0.1 * (1 / 2.0 - 1 / 8.0) / 0.5, 2);
  EXPECT_EQ(found, std::round(found));
  EXPECT_NEAR(planes({2, 8}, 1, all(rig)), (found + 1) / 2, 1);
  EXPECT_EQ(planes({3, 3}, 0.5, all(rig)), 1);
  EXPECT_EQ(planes({2, 8}, 0.5, {4}), 1);  // no camera to compare with
  EXPECT_GT(planes({1e-3, 8}, 0.05, all(rig)), 10'000);

  const SweepPlanes across = evenly_spaced_planes({1.0 / 8, 0.5}, 7);
  EXPECT_EQ(across.count, 7);
  EXPECT_NEAR(across.farthest, 1.0 / 8, 1e-12);
  EXPECT_NEAR(across.nearest(), 0.5, 1e-12);
  EXPECT_NEAR(evenly_spaced_planes({1.0 / 8, 0.5}, 1).farthest, 5.0 / 16, 1e-12);
}

TEST(SweepPlanes, CamerasNextToEachOtherKeepTheNumber) {
  const VirtualCamera view = view_from({0.05, 0.05, 0});
  const auto planes = [&](const rig::Rig& rig, const std::vector<int>& members, int cameras) {
    const auto range = inverse_depth_range_in_view(view, rig, {2, 8});
    const BlendingField field(view, rig, members, range, cameras);
    return required_plane_count(range, view, rig, field, 0.5);
  };
  rig::Rig rig = grid(3);
  const double alone = planes(rig, all(rig), 4);
  for (std::size_t i = 0; i < 9; ++i) {
    rig.cameras.push_back(rig.cameras[i]);
    rig.cameras.back().pose.position.x() += 0.0003;
  }
  EXPECT_NEAR(planes(rig, all(rig), 8), alone, 2);
  // Of the four nearest cameras two are at each of two stations, which may be on a diagonal.
  EXPECT_NEAR(planes(rig, all(rig), 4), 1 + std::sqrt(2) * (alone - 1), 2);
  EXPECT_LE(planes(rig, {4, 13}, 4), 2);  // the pair has nothing but each other
}

}  // namespace
}  // namespace raystage::render
