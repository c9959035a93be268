// SPDX-License-Identifier: Apache-2.0
#include "render/depth/fusion.h"

#include <gtest/gtest.h>

#include <cmath>

namespace raystage {
namespace {

VirtualCamera camera_at(const Eigen::Vector3d& position, int width = 40, int height = 30) {
  Pose pose;
  pose.position = position;
  VirtualCamera camera = virtual_camera_with_fov(width, height, 1, pose);
  camera.intrinsics.fx = camera.intrinsics.fy = width;  // a metre away, a metre wide
  return camera;
}

InverseDepthMap flat(const VirtualCamera& camera, float inverse_depth) {
  InverseDepthMap map{camera.width, camera.height, {}};
  map.values.assign(static_cast<std::size_t>(camera.width * camera.height), inverse_depth);
  return map;
}

float& at(InverseDepthMap& map, int x, int y) {
  return map.values[static_cast<std::size_t>(y * map.width + x)];
}

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
  CameraGeometry geometry;
  geometry.id = "c";
  geometry.width = 64;
  geometry.height = 48;
  geometry.intrinsics = {50, 52, 31, 23, {}};
  const VirtualCamera same = undistorted(CameraModel(geometry), {});
  EXPECT_EQ(same.width, 64);
  EXPECT_EQ(same.intrinsics.cx, 31);
  geometry.intrinsics.distortion.k1 = -0.15;  // the frame's corners lie far out
  const CameraModel model(geometry);
  const VirtualCamera larger = undistorted(model, {});
  EXPECT_GT(larger.width, 64);
  EXPECT_EQ(larger.intrinsics.distortion, Distortion{});
  const auto ideal = *model.ideal_from_pixel({0, 0});
  EXPECT_GE(larger.intrinsics.fx * ideal.x() + larger.intrinsics.cx, -1e-9);
  EXPECT_GE(larger.intrinsics.fy * ideal.y() + larger.intrinsics.cy, -1e-9);
  geometry.intrinsics.distortion.k1 = -0.5;  // folds back within the frame
  const VirtualCamera bounded = undistorted(CameraModel(geometry), {});
  EXPECT_LE(bounded.width, 128);
  EXPECT_LE(bounded.height, 96);
}

TEST(WarpDepths, TheNearerHidesTheFarther) {
  const VirtualCamera camera = camera_at({0, 0, 0}), view = camera_at({0.1, 0, 0});
  InverseDepthMap map = flat(camera, 0.25F);  // moves by one pixel
  at(map, 20, 10) = 1;                        // by four: onto what comes from 17
  const InverseDepthMap warped = warp_depths(map, camera, view);
  EXPECT_FLOAT_EQ(warped.at(16, 10), 1);
  EXPECT_FLOAT_EQ(warped.at(15, 10), 0.25F);
  EXPECT_EQ(warped.at(19, 10), kUnknownDepth);  // bared
  EXPECT_EQ(warped.at(39, 10), kUnknownDepth);  // beyond the camera's frame
}

TEST(WarpDepths, LeavesNoHolesWhereTheViewIsSharper) {
  const VirtualCamera camera = camera_at({0, 0, 0}), sharper = camera_at({0, 0, 0}, 120, 90);
  const InverseDepthMap warped = warp_depths(flat(camera, 0.5F), camera, sharper);
  for (const float depth : warped.values) ASSERT_FLOAT_EQ(depth, 0.5F);
  const VirtualCamera nearer = camera_at({0, 0, -1});  // half as far away
  const InverseDepthMap close = warp_depths(flat(camera, 0.5F), camera, nearer);
  for (const float depth : close.values) ASSERT_FLOAT_EQ(depth, 1);
}

TEST(FuseDepths, TheMajorityDecidesAndHolesAreFilledFromBehind) {
  const VirtualCamera view = camera_at({0, 0, 0});
  InverseDepthMap right = flat(view, 0.5F), also = right, wrong = flat(view, 0.9F);
  for (int y = 0; y < view.height; ++y) {
    for (int x = 20; x < 30; ++x) {  // nobody knows, next to something near
      at(right, x, y) = at(also, x, y) = at(wrong, x, y) = kUnknownDepth;
    }
    for (int x = 30; x < 40; ++x) at(right, x, y) = at(also, x, y) = 2;
  }
  const std::vector<DepthReport> reports{{&right, &view, 1}, {&wrong, &view, 1}, {&also, &view, 1}};
  const InverseDepthMap fused = fuse_depths(view, reports, {0.1F, 0.5F});
  EXPECT_FLOAT_EQ(fused.at(5, 15), 0.5F);
  EXPECT_FLOAT_EQ(fused.at(25, 15), 0.5F);
  EXPECT_FLOAT_EQ(fused.at(35, 15), 2);
  const InverseDepthMap nothing = flat(view, kUnknownDepth);
  const std::vector<DepthReport> nobody{{&nothing, &view, 1}};
  EXPECT_EQ(fuse_depths(view, nobody, {0.1F, 0.5F}).at(5, 5), kUnknownDepth);
}

TEST(SmoothAlongLinks, SpreadsWithinAndNotAcross) {
  constexpr int kWidth = 70, kHeight = 9;
  PixelLinks links;
  links.left.assign(kWidth * kHeight, 0.8F);
  links.above.assign(kWidth * kHeight, 0.8F);
  for (std::size_t y = 0; y < kHeight; ++y) links.left[y * kWidth + 35] = 0;  // an edge
  std::vector<float> values(2 * kWidth * kHeight, 0.0F);
  const std::size_t spike = 4 * kWidth + 30;
  values[2 * spike] = 1;
  for (std::size_t i = 0; i < kWidth * kHeight; ++i) values[2 * i + 1] = 3;  // stays flat
  smooth_along_links(values, 2, kWidth, kHeight, links);
  EXPECT_LT(values[2 * spike], 0.2F);
  EXPECT_GT(values[2 * spike + 2], 0.001F);
  EXPECT_GT(values[2 * (spike - kWidth)], 0.001F);
  EXPECT_EQ(values[2 * (spike + 5)], 0);
  for (std::size_t i = 0; i < kWidth * kHeight; ++i) ASSERT_NEAR(values[2 * i + 1], 3, 1e-5);
}

}  // namespace
}  // namespace raystage
