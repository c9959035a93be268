// SPDX-License-Identifier: Apache-2.0
// Tests of slabs on all sides of a box of cameras that look outwards.
#include <gtest/gtest.h>

#include <Eigen/Core>
#include <array>
#include <cmath>
#include <string>

#include "testing/render/synthetic_take.h"
#include "testing/render/test_slabs.h"

namespace raystage::render::slabs_box_test {
namespace {

using Eigen::Vector3d;
using testing::FastAndReference;
using testing::kDegree;
using testing::make_pose;
using testing::mean_alpha;
using testing::render_both;
using testing::RenderCase;
using testing::SyntheticTake;

class SlabsBox : public ::testing::Test {
 protected:
  store::Take write(const SyntheticTake& settings, const std::string& name = "take") {
    write_synthetic_take(settings, folder_.path() / name);
    return store::Take(folder_.path() / name);
  }
  testing::TestFolder folder_;
};

/// Returns 24 cameras on the faces of a box, which look outwards.
SyntheticTake box_take() {
  SyntheticTake settings;
  for (int side = 0; side < 6; ++side) {
    const rig::Pose out =
        side < 4 ? make_pose({0, 0, 0}, side * 90) : make_pose({0, 0, 0}, 0, side == 4 ? 90 : -90);
    for (schemas::CameraGeometry camera : testing::camera_grid(2, 2, 0.8, 120, 120)) {
      camera.id = std::to_string(side) + camera.id;
      camera.intrinsics.fx = camera.intrinsics.fy = 55;  // 95 degrees
      rig::Pose pose = rig::pose_from_matrix(camera.world_from_camera);
      pose.position = out.world_from_camera_rotation * (pose.position - Vector3d(0, 0, 0.2));
      pose.world_from_camera_rotation = out.world_from_camera_rotation;
      camera.world_from_camera = rig::matrix_from_pose(pose);
      settings.cameras.push_back(camera);
    }
  }
  return settings;
}

std::array<double, 3> painted_direction(const Vector3d& d) {
  const Vector3d u = d.normalized();
  return {0.5 + 0.3 * std::sin(5 * u.x() + u.y()), 0.5 + 0.3 * std::sin(4 * u.y()),
          0.5 + 0.3 * std::cos(5 * u.z() - u.x())};
}

/// Returns the largest error of any channel, against the scene along the view's rays.
double worst_error(const RenderedView& image, const VirtualCamera& view,
                   const testing::SceneFunction& scene) {
  double worst = 0;
  for (int y = 0; y < view.height; ++y) {
    for (int x = 0; x < view.width; ++x) {
      const Vector3d ray(x + 0.5 - view.intrinsics.cx, view.intrinsics.cy - y - 0.5,
                         -view.intrinsics.fx);
      const auto truth = scene(view.pose.position, view.pose.world_from_camera_rotation * ray);
      for (std::size_t c = 0; c < 3; ++c) {
        const auto at = static_cast<std::size_t>(y * view.width + x) * 4 + c;
        worst = std::max(worst, std::abs(truth[c] - static_cast<double>(image.rgba[at])));
      }
    }
  }
  return worst;
}

TEST_F(SlabsBox, ABoxLooksAllAround) {
  SyntheticTake settings = box_take();
  // The scene is at infinity: its light depends on the direction alone.
  settings.scene = [](const Vector3d&, const Vector3d& d) { return painted_direction(d); };
  const store::Take take = write(settings);
  const RenderCase box{.plane = {0, 0, 0, 1}, .options = {{"layout", "box"}}};
  for (const auto& [yaw, pitch] : {std::pair{0.0, 0.0},
                                   {45.0, 0.0},
                                   {190.0, 20.0},
                                   {45.0, 40.0},
                                   {0.0, 90.0},
                                   {60.0, -70.0}}) {
    SCOPED_TRACE(yaw);
    const VirtualCamera view =
        virtual_camera_with_fov(100, 80, 100 * kDegree, make_pose({0.03, 0.02, -0.01}, yaw, pitch));
    const FastAndReference pair = render_both(take, view, box);
    expect_equal(pair, 2e-3, 2e-3);
    EXPECT_GT(mean_alpha(pair.fast), 0.999);
    EXPECT_LT(worst_error(pair.fast, view, settings.scene), 0.04);
  }
  // A side without cameras is empty; the others are rendered.
  settings.cameras.erase(settings.cameras.begin(), settings.cameras.begin() + 4);
  const store::Take open = write(settings, "open");
  const FastAndReference front = render_both(
      open, virtual_camera_with_fov(90, 60, 60 * kDegree, make_pose({0.03, 0.02, -0.01}, 0)), box);
  expect_equal(front);
  EXPECT_EQ(mean_alpha(front.fast), 0);
}

TEST_F(SlabsBox, EveryFaceOfABoxIsInFocusAtTheSameDistance) {
  // The scene is the walls of a room, 5 m away on all sides.
  SyntheticTake settings = box_take();
  const auto on_wall = [](const Vector3d& origin, const Vector3d& d) {
    double nearest = 1e9;
    for (int axis = 0; axis < 3; ++axis) {
      if (d[axis] == 0) continue;
      nearest = std::min(nearest, (std::copysign(5, d[axis]) - origin[axis]) / d[axis]);
    }
    return Vector3d(origin + nearest * d);
  };
  settings.scene = [&](const Vector3d& origin, const Vector3d& d) {
    return painted_direction(on_wall(origin, d));
  };
  const store::Take take = write(settings);
  const RenderCase box{.plane = {0, 0, 1, 5}, .options = {{"layout", "box"}}};
  for (const auto& [yaw, pitch] :
       {std::pair{0.0, 0.0}, {90.0, 0.0}, {180.0, 0.0}, {-90.0, 0.0}, {0.0, 90.0}, {0.0, -90.0}}) {
    SCOPED_TRACE(std::to_string(yaw) + " " + std::to_string(pitch));
    const VirtualCamera view =
        virtual_camera_with_fov(60, 60, 50 * kDegree, make_pose({0.1, -0.08, 0.06}, yaw, pitch));
    const FastAndReference pair = render_both(take, view, box);
    expect_equal(pair, 2e-3, 2e-3);
    EXPECT_GT(mean_alpha(pair.fast), 0.999);
    EXPECT_LT(worst_error(pair.fast, view, settings.scene), 0.04);
  }
}

}  // namespace
}  // namespace raystage::render::slabs_box_test
