// SPDX-License-Identifier: Apache-2.0
// Tests of RenderedView::cameras and nearest_ray: the number of cameras behind a pixel, and the
// distance of the nearest one from its ray.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>

#include "render/methods.h"
#include "render/renderer.h"
#include "testing/render/synthetic_take.h"
#include "testing/render/test_matte.h"

namespace raystage::render {
namespace {

using Eigen::Vector3d;

class CoverageMeasures : public ::testing::Test {
 protected:
  void SetUp() override {
    testing::SyntheticTake settings;
    settings.cameras = testing::camera_grid(3, 3, 0.06, 160, 120, {-0.15, 0.02, 0, 0, 0});
    settings.absent = {{8, 0}};
    write_synthetic_take(settings, folder_.path() / "take");
    const std::vector<std::uint8_t> all(std::size_t{160} * 120, 255);
    for (const schemas::CameraGeometry& camera : settings.cameras) {
      testing::write_matte(folder_.path() / "take", camera.id, 0, 160, 120, all);
    }
  }
  RenderedView render(const std::string& method, const Vector3d& eye, bool reference = false,
                      bool measured = true, const schemas::OptionValues& options = {},
                      const Eigen::Matrix3d& rotation = Eigen::Matrix3d::Identity()) const {
    const store::Take take(folder_.path() / "take");
    VirtualCamera view = virtual_camera_with_fov(91, 71, 0.8, {rotation, eye});
    RendererOptions settings;
    settings.measure_coverage = measured;
    settings.reference = reference;
    return LightFieldRenderer(take, settings)
        .render(view, store::select_frames(take, 0, 1), {method, {0, 0, 1, 4}, options});
  }
  static constexpr std::size_t kMiddle = 35 * 91 + 45;
  testing::TestFolder folder_;
};

TEST_F(CoverageMeasures, AgreeWithTheReferenceForEveryMethod) {
  for (const Method* method : methods()) {
    const std::string name(method->name());
    ASSERT_TRUE(method->measures_coverage()) << name;
    // The hull's reference takes 4096 steps along each ray, which is coarser than the tolerance
    // here.
    if (name == "visual_hull") continue;
    for (const Vector3d& eye : {Vector3d(0.01, 0.02, 0.05), Vector3d(0.02, 0, -0.1)}) {
      const RenderedView fast = render(name, eye), reference = render(name, eye, true);
      std::size_t compared = 0, differ = 0;
      for (std::size_t i = 0; i < fast.coverage.size(); ++i) {
        if (reference.rgba[4 * i + 3] < 0.999F) continue;
        ++compared;
        const bool agree = std::abs(fast.cameras[i] - reference.cameras[i]) < 0.02F &&
                           std::abs(fast.nearest_ray[i] - reference.nearest_ray[i]) < 1e-5F;
        differ += agree ? 0 : 1;
      }
      EXPECT_GT(compared, fast.coverage.size() / 2) << name;
      EXPECT_LE(differ, compared / 200) << name;  // where one camera replaces another
    }
  }
}

TEST_F(CoverageMeasures, CountCamerasAndDistances) {
  const Vector3d at_camera(0, 0, 0), between(0.02, 0.02, 0);  // the cell's centroid
  for (const char* method : {"focal_plane", "nearest", "lumigraph"}) {
    const RenderedView image = render(method, at_camera);
    EXPECT_NEAR(image.cameras[kMiddle], 1, 0.02) << method;
    EXPECT_NEAR(image.nearest_ray[kMiddle], 0, 1e-6) << method;
  }
  EXPECT_NEAR(render("focal_plane", between).cameras[kMiddle], 3, 0.05);
  EXPECT_NEAR(render("focal_plane", between).nearest_ray[kMiddle], std::hypot(0.02, 0.02), 1e-5);
  EXPECT_EQ(render("nearest", between).cameras[kMiddle], 1);
  for (const char* method : {"lumigraph", "plane_sweep", "depth"}) {
    const RenderedView image = render(method, between);
    EXPECT_NEAR(image.nearest_ray[kMiddle], std::hypot(0.02, 0.02), 1e-5) << method;
    EXPECT_GT(image.cameras[kMiddle], 2) << method;
    EXPECT_LE(image.cameras[kMiddle], 8) << method;
  }
}

TEST_F(CoverageMeasures, CountTheCamerasOfAnAperture) {
  // Of the eight other cameras within 0.1 m of the middle one, one is absent. Four and three of
  // them have equal weights.
  const RenderedView image = render("aperture", {0, 0, 0}, false, true, {{"radius", 0.1}});
  const auto weight = [](double q_squared) {
    const double t = 1 - q_squared;
    return t * t * (3 - 2 * t);
  };
  const double beside = weight(0.36), across = weight(0.72);
  const double sum = 1 + 4 * beside + 3 * across;
  const double squares = 1 + 4 * beside * beside + 3 * across * across;
  EXPECT_NEAR(image.cameras[kMiddle], sum * sum / squares, 1e-3);
  EXPECT_NEAR(image.nearest_ray[kMiddle], 0, 1e-6);
}

TEST_F(CoverageMeasures, CountTheCamerasBehindASlabsNodes) {
  // The view is at a quarter of the way between four cameras, which are nodes themselves.
  const RenderedView image = render("slabs", {0.015, 0.015, 0});
  const double sum = 1, squares = 0.75 * 0.75 * 0.75 * 0.75 + 2 * 0.75 * 0.75 * 0.25 * 0.25 +
                                  0.25 * 0.25 * 0.25 * 0.25;
  EXPECT_NEAR(image.cameras[kMiddle], sum / squares, 1e-3);
  EXPECT_NEAR(image.nearest_ray[kMiddle], std::hypot(0.015, 0.015), 1e-5);
}

TEST_F(CoverageMeasures, AutoPassesThemThrough) {
  const RenderedView image = render("auto", {0.02, 0.02, 0}),
                     chosen = render("focal_plane", {0.02, 0.02, 0});
  ASSERT_EQ(image.notes.size(), 1U);
  EXPECT_EQ(image.cameras, chosen.cameras);  // without a depth range in the take a plane is used
  EXPECT_EQ(image.nearest_ray, chosen.nearest_ray);
}

TEST_F(CoverageMeasures, AreOnlyThereOnRequestAndSayWhereNobodySees) {
  // The hull covers everything that the cameras see, so only a view in the other direction sees
  // nothing.
  const Eigen::Matrix3d backwards =
      Eigen::AngleAxisd(std::numbers::pi, Vector3d::UnitY()).toRotationMatrix();
  for (const Method* each : methods()) {
    const std::string method(each->name());
    const RenderedView unmeasured = render(method, {0, 0, 0}, false, false);
    EXPECT_TRUE(unmeasured.cameras.empty()) << method;
    EXPECT_TRUE(unmeasured.nearest_ray.empty()) << method;
    const RenderedView image = render(method, {60, 0, 0}, false, true, {}, backwards);
    ASSERT_EQ(image.cameras.size(), image.coverage.size()) << method;
    ASSERT_EQ(image.rgba[4 * kMiddle + 3], 0) << method;
    EXPECT_EQ(image.cameras[kMiddle], 0) << method;
    EXPECT_EQ(image.nearest_ray[kMiddle], std::numeric_limits<float>::infinity()) << method;
  }
}

/// Returns the light of a narrow screen in front of a wall. Where the view sees the wall, cameras
/// from which the screen hides it must not be counted.
std::array<double, 3> screen_scene(const Vector3d& from, const Vector3d& direction) {
  const Vector3d on_screen = from + (-2 - from.z()) / direction.z() * direction;
  const bool screen = std::abs(on_screen.x()) < 0.15;
  const Vector3d hit = from + ((screen ? -2 : -6) - from.z()) / direction.z() * direction;
  return testing::painted_plane(4 * hit.x(), 4 * hit.y() + (screen ? 1 : 0));
}

TEST_F(CoverageMeasures, CamerasThatSomethingHidesThePointFromDoNotCount) {
  testing::SyntheticTake settings;
  settings.cameras = testing::camera_grid(1, 5, 0.1, 160, 120);
  settings.scene = screen_scene;
  settings.depth_range = schemas::DepthRange{1.8, 7};
  const auto folder = folder_.path() / "screen";
  write_synthetic_take(settings, folder);
  const store::Take take(folder);
  VirtualCamera view = virtual_camera_with_fov(160, 120, 0.8, {});
  view.pose.position = {0.05, 0, 0};
  RendererOptions measuring;
  measuring.measure_coverage = true;
  const RenderedView image =
      LightFieldRenderer(take, measuring)
          .render(view, store::select_frames(take, 0, 1), {"depth", {0, 0, 0, 1}, {}});
  // Just right of the screen, the cameras to the left see the screen.
  const auto column = [&](double x_over_depth) {
    return static_cast<std::size_t>(view.intrinsics.fx * x_over_depth + view.intrinsics.cx);
  };
  const std::size_t row = 60 * 160;
  const float beside = image.cameras[row + column(0.065)], open = image.cameras[row + column(0.3)];
  EXPECT_GT(image.z[row + column(0.065)], 5);
  EXPECT_GE(beside, 1);
  EXPECT_LT(beside, 0.8F * open);
}

}  // namespace
}  // namespace raystage::render
