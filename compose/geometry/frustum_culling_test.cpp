// SPDX-License-Identifier: Apache-2.0
#include "compose/geometry/frustum_culling.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "testing/compose/test_meshes.h"

namespace raystage::compose {
namespace {

using Eigen::Vector3d;

/// All visible meshes pass the test, and few invisible ones.
TEST(InView, LeavesOutNothingThatShows) {
  const EmbreeMesh ball(testing::ball(1, testing::make_material(Material::Kind::kDiffuse), 12),
                        "ball");
  std::mt19937 random(3);
  std::uniform_real_distribution<double> place(-6, 6), turn(-3, 3);
  int seen = 0, left_out = 0, in_vain = 0;
  for (int i = 0; i < 1000; ++i) {
    render::VirtualCamera camera = render::virtual_camera_with_fov(40, 30, 0.9, {});
    camera.intrinsics.cx += turn(random);
    camera.pose.world_from_camera_rotation =
        Eigen::AngleAxisd(turn(random), Vector3d(turn(random), turn(random), 1).normalized())
            .toRotationMatrix();
    camera.pose.position = {place(random), place(random), place(random)};
    GeometryScene scene;
    scene.meshes = {
        testing::make_instance(ball, {place(random), place(random), place(random)}, 0.5)};
    const LayerImage image = render_geometry(scene, 0, camera, 1);
    bool shows = false;
    for (std::size_t at = 3; at < image.rgba.size(); at += 4) shows = shows || image.rgba[at] > 0;
    const bool may_show = may_intersect_frustum(scene.meshes[0], camera);
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
  const EmbreeMesh seen(testing::square(1, testing::make_material(Material::Kind::kDiffuse)), "s");
  const EmbreeMesh aside(testing::ball(1, testing::make_material(Material::Kind::kDiffuse), 8),
                         "b");
  GeometryScene scene;
  scene.meshes = {testing::make_instance(seen, {0, 0, -3}),
                  testing::make_instance(aside, {50, 0, -3})};
  scene.lights.direct.push_back({{0, 0, 1}});
  render_geometry(scene, 0, render::virtual_camera_with_fov(16, 12, 0.6, {}), 1);
  EXPECT_TRUE(seen.is_built());
  EXPECT_FALSE(aside.is_built());
  // A mesh that casts shadows is needed.
  scene.meshes[1] = testing::make_instance(aside, {0, 0, 5});
  render_geometry(scene, 0, render::virtual_camera_with_fov(16, 12, 0.6, {}), 1);
  EXPECT_TRUE(aside.is_built());
}

TEST(InView, KnowsStretchedMeshes) {
  const EmbreeMesh square(testing::square(1, testing::make_material(Material::Kind::kDiffuse)),
                          "s");
  MeshInstance placed = testing::make_instance(square, {5, 0, -3});
  const render::VirtualCamera camera = render::virtual_camera_with_fov(40, 30, 0.9, {});
  EXPECT_FALSE(may_intersect_frustum(placed, camera));
  placed.world_from_object.scale(Vector3d(10, 1, 1));
  EXPECT_TRUE(may_intersect_frustum(placed, camera));
}

}  // namespace
}  // namespace raystage::compose
