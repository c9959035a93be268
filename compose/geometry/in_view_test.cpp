// SPDX-License-Identifier: Apache-2.0
#include "compose/geometry/in_view.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "compose/geometry/test_meshes.h"

namespace raystage {
namespace {

using Eigen::Vector3d;

/// Whatever is rendered must have been said to be in view, and little that shows nothing.
TEST(InView, LeavesOutNothingThatShows) {
  const MeshScene ball(testing::ball(1, testing::material_of(Material::Kind::kDiffuse), 12),
                       "ball");
  std::mt19937 random(3);
  std::uniform_real_distribution<double> place(-6, 6), turn(-3, 3);
  int seen = 0, left_out = 0, in_vain = 0;
  for (int i = 0; i < 1000; ++i) {
    VirtualCamera camera = virtual_camera_with_fov(40, 30, 0.9, {});
    camera.intrinsics.cx += turn(random);
    camera.pose.world_from_camera_rotation =
        Eigen::AngleAxisd(turn(random), Vector3d(turn(random), turn(random), 1).normalized())
            .toRotationMatrix();
    camera.pose.position = {place(random), place(random), place(random)};
    GeometryScene scene;
    scene.meshes = {testing::placed_at(ball, {place(random), place(random), place(random)}, 0.5)};
    const LayerImage image = render_geometry(scene, 0, camera, 1);
    bool shows = false;
    for (std::size_t at = 3; at < image.rgba.size(); at += 4) shows = shows || image.rgba[at] > 0;
    const bool may_show = may_be_in_view(scene.meshes[0], camera);
    EXPECT_TRUE(may_show || !shows) << i;
    seen += shows ? 1 : 0;
    left_out += may_show ? 0 : 1;
    in_vain += may_show && !shows ? 1 : 0;
  }
  EXPECT_GT(seen, 20);
  EXPECT_GT(left_out, 750);
  EXPECT_LT(in_vain, 100);
}

TEST(InView, MeshesThatNoRayComesNearAreNotBuilt) {
  const MeshScene seen(testing::square(1, testing::material_of(Material::Kind::kDiffuse)), "s");
  const MeshScene aside(testing::ball(1, testing::material_of(Material::Kind::kDiffuse), 8), "b");
  GeometryScene scene;
  scene.meshes = {testing::placed_at(seen, {0, 0, -3}), testing::placed_at(aside, {50, 0, -3})};
  scene.lights.directional.push_back({{0, 0, 1}});
  render_geometry(scene, 0, virtual_camera_with_fov(16, 12, 0.6, {}), 1);
  EXPECT_TRUE(seen.is_prepared());
  EXPECT_FALSE(aside.is_prepared());
  // In the way of the light it is one of them.
  scene.meshes[1] = testing::placed_at(aside, {0, 0, 5});
  render_geometry(scene, 0, virtual_camera_with_fov(16, 12, 0.6, {}), 1);
  EXPECT_TRUE(aside.is_prepared());
}

TEST(InView, KnowsStretchedMeshes) {
  const MeshScene square(testing::square(1, testing::material_of(Material::Kind::kDiffuse)), "s");
  PlacedMesh placed = testing::placed_at(square, {5, 0, -3});
  const VirtualCamera camera = virtual_camera_with_fov(40, 30, 0.9, {});
  EXPECT_FALSE(may_be_in_view(placed, camera));
  placed.world_from_object.scale(Vector3d(10, 1, 1));
  EXPECT_TRUE(may_be_in_view(placed, camera));
}

}  // namespace
}  // namespace raystage
