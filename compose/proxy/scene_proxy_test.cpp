// SPDX-License-Identifier: Apache-2.0
#include "compose/proxy/scene_proxy.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <limits>
#include <set>

#include "base/error.h"
#include "testing/render/synthetic_take.h"
#include "testing/test_folder.h"

namespace raystage::compose {
namespace {

constexpr int kWidth = 40, kHeight = 30;
const Eigen::Vector3d kWorld = Eigen::Vector3d::Zero();

/// Returns a camera at (1, 2, 3), turned to look along the world's -x.
render::VirtualCamera camera() {
  render::VirtualCamera view{kWidth, kHeight, {50, 50, 18, 16, {}}, {}};
  view.pose.position = {1, 2, 3};
  view.pose.world_from_camera_rotation =
      Eigen::AngleAxisd(std::acos(-1.0) / 2, Eigen::Vector3d::UnitY()).toRotationMatrix();
  return view;
}

/// Returns its view of a wall 2 m away, half of which is a wall 5 m away.
render::RenderedView two_walls() {
  render::RenderedView view = render::empty_view(camera());
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const std::size_t i = view.index(x, y);
      view.z[i] = x < kWidth / 2 ? 2.0F : 5.0F;
      for (int c = 0; c < 4; ++c) view.rgba[4 * i + c] = c == 0 ? 0.25F : c == 3 ? 0.5F : 0.0F;
    }
  }
  return view;
}

TEST(SceneProxy, PointsAreOnTheSurfaces) {
  const std::vector<ProxyPoint> points = points_of_view(two_walls(), camera(), kWorld);
  ASSERT_EQ(points.size(), static_cast<std::size_t>(kWidth * kHeight));
  // The first pixel: 17.5 px left of and 15.5 px above the axis. The camera's right is world -z.
  const Eigen::Vector3f expected(1 - 2, 2 + 15.5F * 2 / 50, 3 + 17.5F * 2 / 50);
  EXPECT_LT((points[0].position - expected).norm(), 1e-5);
  EXPECT_EQ(points[0].color, (std::array<std::uint8_t, 3>{188, 0, 0}));  // 0.5 of light
  EXPECT_NEAR(points[kWidth - 1].position.x(), 1 - 5, 1e-5);
}

TEST(SceneProxy, WhatIsNotASurfaceIsLeftOut) {
  render::RenderedView view = two_walls();
  view.z[view.index(5, 5)] = 3;                                       // between two depths
  view.z[view.index(9, 5)] = std::numeric_limits<float>::infinity();  // the sky
  view.rgba[4 * view.index(12, 5) + 3] = 0.1F;                        // hardly seen
  EXPECT_EQ(points_of_view(view, camera(), kWorld).size(),
            static_cast<std::size_t>(kWidth * kHeight - 3));
}

TEST(SceneProxy, AMeshIsCutWhereDepthJumps) {
  const ProxyMesh mesh = mesh_of_view(two_walls(), camera(), kWorld);
  EXPECT_EQ(mesh.positions.size(), static_cast<std::size_t>(kWidth * kHeight));
  // One column of quadrilaterals, between the walls, is missing.
  EXPECT_EQ(mesh.triangles.size(), static_cast<std::size_t>(2 * (kWidth - 2) * (kHeight - 1)));
  for (const auto& [a, b, c] : mesh.triangles) {
    const Eigen::Vector3f normal = (mesh.positions[b] - mesh.positions[a])
                                       .cross(mesh.positions[c] - mesh.positions[a])
                                       .normalized();
    EXPECT_GT(normal.x(), 0.99F);  // towards the camera
  }
  EXPECT_EQ(mesh.texture.width, kWidth);
  EXPECT_NEAR(mesh.texture_coordinates[0].x(), 0.5 / kWidth, 1e-6);
}

TEST(SceneProxy, ThinningKeepsOnePointPerCell) {
  std::vector<ProxyPoint> points;
  for (int i = 0; i < 1000; ++i) points.push_back({{0.01F * static_cast<float>(i), 0, -1}, {}});
  EXPECT_EQ(thin_out(points, 1e-3, 5000).size(), 1000U);
  EXPECT_NEAR(thin_out(points, 0.1, 5000).size(), 100, 2);
  const std::vector<ProxyPoint> few = thin_out(points, 1e-3, 100);
  EXPECT_LE(few.size(), 100U);
  EXPECT_GT(few.size(), 40U);
  EXPECT_TRUE(thin_out({}, 1, 10).empty());
  EXPECT_EQ(thin_out({{{1e30F, -1e30F, 0}, {}}}, 1e-6, 10).size(), 1U);
}

TEST(SceneProxy, ATakesSceneIsWhereItIs) {
  // The second array has UTM coordinates, which floats hold to 0.5 m.
  for (const std::array<double, 3>& place : {std::array{0.0, 0.0, 0.0}, {456'789.3, 210, -5e6}}) {
    const testing::TestFolder folder;
    testing::SyntheticTake synthetic;
    synthetic.cameras = testing::camera_grid(3, 3, 0.1, 160, 120, {-0.1, 0.01, 0, 0, 0});
    synthetic.origin = place;
    synthetic.depth_range = schemas::DepthRange{3, 6};
    write_synthetic_take(synthetic, folder.path() / "take");
    const store::Take take(folder.path() / "take");
    const store::Timeline timeline = store::build_timeline(take, 15, 0);
    SceneProxyOptions options;
    options.width = 120;
    const PointCloud cloud = make_point_cloud(take, timeline, options);
    ASSERT_GT(cloud.points.size(), 3000U);
    const double wall = place[2] - 4;
    double square = 0;
    for (const ProxyPoint& point : cloud.points) {
      square += std::pow(cloud.origin.z() + double{point.position.z()} - wall, 2);
    }
    EXPECT_LT(std::sqrt(square / static_cast<double>(cloud.points.size())), 0.1);  // metres, of 4
    const ProxyMesh mesh = make_proxy_mesh(take, timeline, options);
    EXPECT_GT(mesh.triangles.size(), 10'000U);
    const bool is_near = place[2] == 0;
    EXPECT_EQ(mesh.origin, is_near ? kWorld : Eigen::Vector3d(456'789, 210, -5e6));
    EXPECT_EQ(mesh.origin, cloud.origin);
    const auto [a, b, c] = mesh.triangles[mesh.triangles.size() / 2];
    const float pixel = (mesh.positions[c] - mesh.positions[a]).norm();
    EXPECT_GT(pixel, 0.01F);
    EXPECT_LT(pixel, 0.1F);
    options.tick = 1;
    EXPECT_THROW(make_point_cloud(take, timeline, options), Error);
    options.tick = 0;
    options.method = "no such method";
    EXPECT_THROW(make_proxy_mesh(take, timeline, options), Error);
  }
}

TEST(SceneProxy, FarFromTheWorldsOriginPositionsHaveTheirOwn) {
  render::VirtualCamera far = camera();
  const Eigen::Vector3d origin(456'789, 210, -5'000'000);
  far.pose.position += origin;
  const std::vector<ProxyPoint> points = points_of_view(two_walls(), far, origin);
  const std::vector<ProxyPoint> near = points_of_view(two_walls(), camera(), kWorld);
  ASSERT_EQ(points.size(), near.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    EXPECT_LT((points[i].position - near[i].position).norm(), 1e-6F);
  }
  const ProxyMesh mesh = mesh_of_view(two_walls(), far, origin);
  EXPECT_EQ(mesh.origin, origin);
  EXPECT_EQ(mesh.positions.back(), points.back().position);
}

}  // namespace
}  // namespace raystage::compose
