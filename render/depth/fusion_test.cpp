// SPDX-License-Identifier: Apache-2.0
#include "render/depth/fusion.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "render/depth/estimation_kernels.h"
#include "render/depth/warp.h"
#include "testing/test_simd_targets.h"

namespace raystage::render::fusion_test {
namespace {

VirtualCamera camera_at(const Eigen::Vector3d& position, int width = 40, int height = 30) {
  rig::Pose pose;
  pose.position = position;
  VirtualCamera camera = virtual_camera_with_fov(width, height, 1, pose);
  camera.intrinsics.fx = camera.intrinsics.fy = width;  // a metre away, a metre wide
  return camera;
}

InverseDepthMap flat(const VirtualCamera& camera, float inverse_depth) {
  return {camera.width, camera.height, inverse_depth};
}

float& at(InverseDepthMap& map, int x, int y) { return map.values[y * map.width + x]; }

TEST(PixelTransfer, FollowsAPointFromCameraToCamera) {
  // 2 m away, a camera 0.1 m to the right sees a point 0.1 / 2 * 40 px further left.
  const PixelTransfer t = pixel_transfer(camera_at({0.1, 0, 0}), camera_at({0, 0, 0}));
  const double x = 20.5, y = 10.5, q = 0.5;
  const auto part = [&](std::size_t r) {
    return t.direction[3 * r] * x + t.direction[3 * r + 1] * y + t.direction[3 * r + 2] +
           q * t.parallax[r];
  };
  EXPECT_NEAR(part(0) / part(2), 18.5, 1e-12);
  EXPECT_NEAR(part(1) / part(2), 10.5, 1e-12);
  EXPECT_NEAR(q / part(2), 0.5, 1e-12);
}

TEST(Undistorted, HoldsWhatTheFrameShows) {
  schemas::CameraGeometry geometry;
  geometry.id = "c";
  geometry.width = 64;
  geometry.height = 48;
  geometry.intrinsics = {50, 52, 31, 23, {}};
  const VirtualCamera same = undistorted(rig::CameraModel(geometry), {});
  EXPECT_EQ(same.width, 64);
  EXPECT_EQ(same.intrinsics.cx, 31);
  geometry.intrinsics.distortion.k1 = -0.15;  // the frame's corners lie far out
  const rig::CameraModel model(geometry);
  const VirtualCamera larger = undistorted(model, {});
  EXPECT_GT(larger.width, 64);
  EXPECT_EQ(larger.intrinsics.distortion, schemas::Distortion{});
  const auto ideal = *model.ideal_from_pixel({0, 0});
  EXPECT_GE(larger.intrinsics.fx * ideal.x() + larger.intrinsics.cx, -1e-9);
  EXPECT_GE(larger.intrinsics.fy * ideal.y() + larger.intrinsics.cy, -1e-9);
  geometry.intrinsics.distortion.k1 = -0.5;  // folds back within the frame
  const VirtualCamera bounded = undistorted(rig::CameraModel(geometry), {});
  EXPECT_LE(bounded.width, 128);
  EXPECT_LE(bounded.height, 96);
}

InverseDepthMap warp_all(const InverseDepthMap& map, const VirtualCamera& camera,
                         const VirtualCamera& view) {
  const DepthTiles tiles =
      warp_depths(map, camera, view, std::vector<std::uint8_t>(depth_tile_count(view), 1));
  InverseDepthMap warped(view.width, view.height);
  for (int y = 0; y < view.height; ++y) {
    for (int x = 0; x < view.width; ++x) {
      const int tile = y / kDepthTile * depth_tile_columns(view) + x / kDepthTile;
      warped.at(x, y) = tiles.row(static_cast<std::size_t>(tile), y % kDepthTile)[x % kDepthTile];
    }
  }
  return warped;
}

TEST(WarpDepths, TheNearerHidesTheFarther) {
  const VirtualCamera camera = camera_at({0, 0, 0}), view = camera_at({0.1, 0, 0});
  InverseDepthMap map = flat(camera, 0.26F);  // moves by a little more than a pixel
  at(map, 20, 10) = 1;                        // moves by four: onto the pixel of column 17
  for (const InverseDepthMap& warped :
       {warp_all(map, camera, view), warp_depths_reference(map, camera, view)}) {
    EXPECT_FLOAT_EQ(warped.at(16, 10), 1);
    EXPECT_FLOAT_EQ(warped.at(15, 10), 0.26F);
    EXPECT_EQ(warped.at(19, 10), kUnknownDepth);  // uncovered
    EXPECT_EQ(warped.at(39, 10), kUnknownDepth);  // beyond the camera's frame
  }
}

TEST(WarpDepths, LeavesNoHolesWhereTheViewIsSharper) {
  const VirtualCamera camera = camera_at({0, 0, 0}), sharper = camera_at({0, 0, 0}, 120, 90);
  const InverseDepthMap warped = warp_all(flat(camera, 0.5F), camera, sharper);
  for (const float depth : warped.values) ASSERT_FLOAT_EQ(depth, 0.5F);
  const VirtualCamera nearer = camera_at({0, 0, -1});  // half as far away
  const InverseDepthMap close = warp_all(flat(camera, 0.5F), camera, nearer);
  for (const float depth : close.values) ASSERT_FLOAT_EQ(depth, 1);
}

TEST(WarpDepths, EveryInstructionSetAgreesWithTheReference) {
  const VirtualCamera camera = camera_at({0, 0, 0}, 71, 50);
  InverseDepthMap map = flat(camera, 0);
  std::mt19937 random(5);
  for (float& depth : map.values) {
    const unsigned choice = random() % 10;
    depth = choice == 0 ? kUnknownDepth : 0.2F + 0.05F * static_cast<float>(choice);
  }
  testing::for_each_simd_target(depth_estimation_target, [&] {
    for (const VirtualCamera& view :
         {camera_at({0.31, 0.12, 0.4}, 75, 41),  // at the side and behind
          camera_at({-0.1, 0, -0.9}, 66, 60),    // in front: pixels are stretched
          camera_at({0, 0, -2.6}, 64, 48)}) {    // with most of the scene behind it
      const InverseDepthMap fast = warp_all(map, camera, view);
      const InverseDepthMap slow = warp_depths_reference(map, camera, view);
      int differ = 0, known = 0;
      for (std::size_t i = 0; i < slow.values.size(); ++i) {
        known += slow.values[i] >= 0 ? 1 : 0;
        differ += std::abs(fast.values[i] - slow.values[i]) > 1e-4F ? 1 : 0;
      }
      EXPECT_GT(known, 300);
      EXPECT_LE(differ, known / 200);  // rounded to another pixel
    }
  });
}

TEST(WarpDepths, OnlyWhereItIsWanted) {
  const VirtualCamera camera = camera_at({0, 0, 0}, 70, 60), view = camera_at({0.1, 0, 0}, 70, 60);
  const InverseDepthMap map = flat(camera, 0.3F);
  std::vector<std::uint8_t> wanted(depth_tile_count(view));
  wanted[1] = 1;
  const DepthTiles tiles = warp_depths(map, camera, view, wanted);
  EXPECT_FALSE(tiles.wanted(0));
  ASSERT_TRUE(tiles.wanted(1));
  EXPECT_EQ(tiles.values.size(), 2U * kDepthTile * kDepthTile);
  for (int y = 0; y < kDepthTile; ++y) {
    for (int x = 0; x < kDepthTile; ++x) ASSERT_FLOAT_EQ(tiles.row(1, y)[x], 0.3F);
  }
}

TEST(WarpDepths, WhatIsNotLookedAtIsNotMissed) {
  const VirtualCamera camera = camera_at({0, 0, 0}, 170, 130);
  InverseDepthMap map = flat(camera, 0);
  std::mt19937 random(9);
  for (std::size_t i = 0; i < map.values.size(); ++i) {
    const bool known = random() % 5 != 0;
    map.values[i] = known ? 0.1F + 0.003F * static_cast<float>(i % 170) : kUnknownDepth;
  }
  const InverseDepthMap nearest = block_nearest_depths(map);
  for (const VirtualCamera& view :
       {camera_at({0.3, 0.1, 0.2}, 160, 100), camera_at({-0.2, 0, -1.2}, 200, 150),
        camera_at({0, 0.1, -1.9}, 100, 100)}) {
    for (std::size_t one = 0; one < depth_tile_count(view); ++one) {
      std::vector<std::uint8_t> wanted(depth_tile_count(view));
      wanted[one] = 1;
      ASSERT_EQ(warp_depths(map, camera, view, wanted, &nearest).values,
                warp_depths(map, camera, view, wanted).values)
          << one;
    }
  }
}

TEST(FuseDepths, TheMajorityDecidesAndHolesAreFilledFromBehind) {
  const VirtualCamera view = camera_at({0, 0, 0});
  InverseDepthMap right = flat(view, 0.5F), also = right, wrong = flat(view, 0.9F);
  for (int y = 0; y < view.height; ++y) {
    for (int x = 20; x < 30; ++x) {  // unknown, next to a near depth
      at(right, x, y) = at(also, x, y) = at(wrong, x, y) = kUnknownDepth;
    }
    for (int x = 30; x < 40; ++x) at(right, x, y) = at(also, x, y) = 2;
  }
  const auto one = uniform_weights(view, 1);
  const std::vector<DepthHypotheses> hypotheses{
      {&right, &view, one}, {&wrong, &view, one}, {&also, &view, one}};
  const InverseDepthMap fused = fuse_hypotheses(view, hypotheses, {0.1F, 0.5F});
  EXPECT_FLOAT_EQ(fused.at(5, 15), 0.5F);
  EXPECT_FLOAT_EQ(fused.at(25, 15), 0.5F);
  EXPECT_FLOAT_EQ(fused.at(35, 15), 2);
  const InverseDepthMap nothing = flat(view, kUnknownDepth);
  const std::vector<DepthHypotheses> nobody{{&nothing, &view, one}};
  EXPECT_EQ(fuse_hypotheses(view, nobody, {0.1F, 0.5F}).at(5, 5), kUnknownDepth);
}

TEST(FuseDepths, KeepsLinesOnePixelWideAndNotSpecks) {
  const VirtualCamera view = camera_at({0, 0, 0});
  constexpr float kBehind = 0.4F, kNear = 0.8F;
  InverseDepthMap map = flat(view, kBehind);
  for (int y = 0; y < view.height; ++y) at(map, 20, y) = kNear;   // a wire
  for (int i = 0; i < 12; ++i) at(map, 25 + i, 10 + i) = kNear;   // another, slanted
  at(map, 5, 5) = at(map, 6, 5) = kNear;                          // a speck
  for (int y = 0; y < view.height; ++y) at(map, 12, y) = 0.001F;  // a crack: wrong, or background
  const std::vector<DepthHypotheses> hypotheses{{&map, &view, uniform_weights(view, 1)}};
  const InverseDepthMap fused = fuse_hypotheses(view, hypotheses, {0.1F, 0.2F, 0.1F});
  const InverseDepthMap plain = fuse_hypotheses(view, hypotheses, {0.1F, 0.2F});
  for (int y = 1; y + 1 < view.height; ++y) {
    EXPECT_EQ(fused.at(20, y), kNear);
    EXPECT_EQ(plain.at(20, y), kBehind);
    EXPECT_EQ(fused.at(12, y), kBehind);
  }
  for (int i = 1; i < 11; ++i) EXPECT_EQ(fused.at(25 + i, 10 + i), kNear);
  EXPECT_EQ(fused.at(5, 5), kBehind);
  EXPECT_EQ(fused.at(6, 5), kBehind);
  EXPECT_EQ(fused.values, fuse_hypotheses_reference(view, hypotheses, {0.1F, 0.2F, 0.1F}).values);
}

TEST(FuseDepths, WeightsGoOverFromCameraToCamera) {
  const VirtualCamera view = camera_at({0, 0, 0}, 64, 32);
  const InverseDepthMap near = flat(view, 0.8F), far = flat(view, 0.4F);
  // Weights linear over tiles: one camera's from 1 to 0, the other's from 0 to 1.
  const std::vector<DepthHypotheses> hypotheses{
      {&near, &view, {{1, 0.5, 1, 0.5}, {0.5, 0, 0.5, 0}}},
      {&far, &view, {{0, 0.5, 0, 0.5}, {0.5, 1, 0.5, 1}}}};
  const InverseDepthMap fused = fuse_hypotheses(view, hypotheses, {0.1F, 0.2F});
  EXPECT_FLOAT_EQ(fused.at(28, 15), 0.8F);
  EXPECT_FLOAT_EQ(fused.at(36, 15), 0.4F);
}

TEST(FuseDepths, InBandsOfRowsTheSameInLessMemory) {
  const VirtualCamera view = camera_at({0, 0, 0}, 170, 230);
  std::mt19937 random(3);
  std::vector<VirtualCamera> cameras;
  std::vector<InverseDepthMap> maps, nearest;
  for (int i = 0; i < 6; ++i) {
    cameras.push_back(camera_at({0.1 * i - 0.3, 0.05 * i, -0.1 * i}, 160, 220));
    maps.push_back(flat(cameras.back(), 0));
    for (float& depth : maps.back().values) {
      const unsigned choice = random() % 10;
      depth = choice == 0 ? kUnknownDepth : 0.3F + 0.02F * static_cast<float>(choice);
    }
    nearest.push_back(block_nearest_depths(maps.back()));
  }
  std::vector<DepthHypotheses> hypotheses;
  for (std::size_t i = 0; i < maps.size(); ++i) {
    hypotheses.push_back({&maps[i], &cameras[i], uniform_weights(view, 1), &nearest[i]});
    hypotheses.back().weights[i] = {};  // a tile in which it has no weight
  }
  const InverseDepthMap whole = fuse_hypotheses(view, hypotheses, {0.03F, 0.3F});
  const std::size_t most = fusion_bytes(view, hypotheses, std::size_t{1} << 30);
  std::size_t last = most;
  for (const std::size_t bytes : {most - 1, most * 2 / 3, std::size_t{0}}) {
    const std::size_t takes = fusion_bytes(view, hypotheses, bytes);
    EXPECT_LT(takes, last);
    last = takes;
    EXPECT_TRUE(takes <= bytes || bytes == 0) << takes;
    EXPECT_EQ(fuse_hypotheses(view, hypotheses,
                              {.tolerance = 0.03F, .min_support = 0.3F, .working_bytes = bytes})
                  .values,
              whole.values);
  }
}

TEST(SmoothAlongLinks, SpreadsWithinAndNotAcross) {
  constexpr int kWidth = 70, kHeight = 9;
  EdgeWeights links;
  links.left.assign(kWidth * kHeight, 0.8F);
  links.above.assign(kWidth * kHeight, 0.8F);
  for (std::size_t y = 0; y < kHeight; ++y) links.left[y * kWidth + 35] = 0;  // an edge
  std::vector<float> values(2 * kWidth * kHeight, 0.0F);
  const std::size_t spike = 4 * kWidth + 30;
  values[2 * spike] = 1;
  for (std::size_t i = 0; i < kWidth * kHeight; ++i) values[2 * i + 1] = 3;  // stays flat
  domain_transform_filter(values, 2, kWidth, kHeight, links);
  EXPECT_LT(values[2 * spike], 0.2F);
  EXPECT_GT(values[2 * spike + 2], 0.001F);
  EXPECT_GT(values[2 * (spike - kWidth)], 0.001F);
  EXPECT_EQ(values[2 * (spike + 5)], 0);
  for (std::size_t i = 0; i < kWidth * kHeight; ++i) ASSERT_NEAR(values[2 * i + 1], 3, 1e-5);
}

}  // namespace
}  // namespace raystage::render::fusion_test
