// SPDX-License-Identifier: Apache-2.0
// Views from within arrays that look outwards, by the methods that look rays up in the array's
// cells: against their references, and against the scene, which surrounds the array.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>

#include "render/planar/aperture.h"
#include "render/planar/aperture_lens.h"
#include "render/renderer.h"
#include "testing/render/synthetic_take.h"
#include "testing/render/test_poses.h"

namespace raystage::render::outward_arrays_test {
namespace {

using Eigen::Vector3d;

constexpr double kRadius = 3;  // of the scene, a painted sphere about the array, metres

/// Returns the colour where the ray leaves the painted sphere.
std::array<double, 3> painted_sphere(const Vector3d& origin, const Vector3d& direction) {
  const Vector3d ray = direction.normalized();
  const double along = origin.dot(ray);
  const Vector3d point =
      origin + ray * (std::sqrt(along * along - origin.squaredNorm() + kRadius * kRadius) - along);
  return {0.5 + 0.4 * std::sin(5 * point.x() + 2 * point.y()), 0.5 + 0.4 * std::sin(4 * point.y()),
          0.5 + 0.4 * std::cos(5 * point.z() - point.x())};
}

/// Returns a camera at `position` that looks away from the origin.
schemas::CameraGeometry outward_camera(const Vector3d& position,
                                       const schemas::Intrinsics& intrinsics, int index) {
  const Vector3d back = -position.normalized();
  const Vector3d above = std::abs(back.y()) > 0.9 ? Vector3d::UnitX() : Vector3d::UnitY();
  const Vector3d right = above.cross(back).normalized();
  const Vector3d up = back.cross(right);
  schemas::CameraGeometry camera{"c" + std::to_string(index), 200, 200, intrinsics, {}, {}, {}};
  camera.world_from_camera = {
      right.x(), up.x(), back.x(), position.x(), right.y(), up.y(), back.y(), position.y(),
      right.z(), up.z(), back.z(), position.z(), 0,         0,      0,        1};
  return camera;
}

schemas::Intrinsics fisheye_180() {
  schemas::Intrinsics lens{60, 60, 100, 100, {}};
  lens.projection = schemas::Projection::kFtheta;
  lens.half_angle = std::numbers::pi / 2;
  return lens;
}

std::vector<schemas::CameraGeometry> sphere_of_fisheyes() {
  std::vector<schemas::CameraGeometry> cameras;
  for (int i = 0; i < 16; ++i) {
    const double height = 1 - (i + 0.5) / 8, across = std::sqrt(1 - height * height);
    const double turn = i * std::numbers::pi * (3 - std::sqrt(5.0));
    const Vector3d outwards(across * std::cos(turn), height, across * std::sin(turn));
    cameras.push_back(outward_camera(0.2 * outwards, fisheye_180(), i));
  }
  return cameras;
}

std::vector<schemas::CameraGeometry> ring_of_pinholes() {
  std::vector<schemas::CameraGeometry> cameras;
  for (int i = 0; i < 10; ++i) {
    const double turn = 2 * std::numbers::pi * i / 10;
    cameras.push_back(
        outward_camera({0.2 * std::cos(turn), 0, 0.2 * std::sin(turn)}, {90, 90, 100, 100, {}}, i));
  }
  return cameras;
}

class OutwardArrays : public ::testing::Test {
 protected:
  store::Take write(std::vector<schemas::CameraGeometry> cameras) {
    testing::SyntheticTake options;
    options.cameras = std::move(cameras);
    options.scene = painted_sphere;
    options.depth_range = schemas::DepthRange{2, 4};
    options.jpeg.quality = 98;
    write_synthetic_take(options, folder_.path() / "take");
    return store::Take(folder_.path() / "take");
  }

  static RenderedView render(const store::Take& take, const VirtualCamera& view,
                             const std::string& method, const schemas::OptionValues& values,
                             bool reference) {
    RendererOptions options;
    options.reference = reference;
    options.count_needed_pixels = !reference;
    const Eigen::Vector4d plane =
        rig::fronto_parallel_plane(take.rig(), kRadius, view.pose.viewing_direction());
    return LightFieldRenderer(take, options)
        .render(view, store::select_frames(take, 0, 30'000'000),
                {.method = method, .focal_plane = plane, .options = values});
  }

  /// Renders a view by the method, compares it with the reference and the scene.
  static void expect_shows_the_scene(const store::Take& take, const VirtualCamera& view,
                                     const std::string& method, const schemas::OptionValues& values,
                                     double max_error) {
    const RenderedView fast = render(take, view, method, values, false);
    const RenderedView slow = render(take, view, method, values, true);
    double worst = 0, covered = 0, error = 0;
    for (std::size_t i = 0; i < fast.coverage.size(); ++i) {
      for (std::size_t c = 0; c < 4; ++c) {
        worst = std::max(worst, std::abs(static_cast<double>(fast.rgba[i * 4 + c]) -
                                         static_cast<double>(slow.rgba[i * 4 + c])));
      }
      covered += static_cast<double>(fast.coverage[i]);
    }
    EXPECT_LT(worst, 2e-3);
    EXPECT_GT(covered / static_cast<double>(fast.coverage.size()), 0.98);
    const Eigen::Matrix3d& world_from_view = view.pose.world_from_camera_rotation;
    for (int y = 0; y < view.height; ++y) {
      for (int x = 0; x < view.width; ++x) {
        const Vector3d ray((x + 0.5 - view.intrinsics.cx) / view.intrinsics.fx,
                           (view.intrinsics.cy - y - 0.5) / view.intrinsics.fy, -1);
        const auto truth = painted_sphere(view.pose.position, world_from_view * ray);
        for (std::size_t c = 0; c < 3; ++c) {
          const double shown = static_cast<double>(fast.rgba[fast.index(x, y) * 4 + c]);
          error += std::abs(shown - truth[c]);
        }
      }
    }
    error /= 3.0 * view.width * view.height;
    EXPECT_LT(error, max_error);
  }

  static std::vector<VirtualCamera> views_within(bool level) {
    std::vector<VirtualCamera> views;
    for (const double yaw : {0.0, 75.0, 170.0, 260.0}) {
      views.push_back(virtual_camera_with_fov(
          64, 48, 50 * testing::kDegree,
          testing::make_pose({0.05, level ? 0.0 : 0.03, -0.04}, yaw, level ? 0.0 : yaw / 2 - 70)));
    }
    return views;
  }

  testing::TestFolder folder_;
};

TEST_F(OutwardArrays, ASphereOfFisheyesShowsTheSceneAllAround) {
  const store::Take take = write(sphere_of_fisheyes());
  ASSERT_TRUE(take.rig().looks_around());
  for (const VirtualCamera& view : views_within(false)) {
    expect_shows_the_scene(take, view, "focal_plane", {}, 0.02);
    expect_shows_the_scene(take, view, "nearest", {}, 0.03);
    expect_shows_the_scene(take, view, "aperture", {}, 0.03);
    expect_shows_the_scene(take, view, "lumigraph", {}, 0.02);
  }
}

// Facets share their fisheye's frame: neither the depths nor the view decode it once for each.
TEST_F(OutwardArrays, FacetsOfAFisheyeAreDecodedTogether) {
  const store::Take take = write(sphere_of_fisheyes());
  const VirtualCamera view = views_within(false).front();
  RendererOptions options;
  options.result_cache = std::make_shared<ResultCache>(std::size_t{1} << 28U);
  const auto decoded = [&] {
    const LightFieldRenderer renderer(take, options);  // holds no frames
    return renderer
        .render(view, store::select_frames(take, 0, 30'000'000),
                {.method = "depth",
                 .focal_plane = rig::fronto_parallel_plane(take.rig(), kRadius),
                 .options = {{"all_cameras", true}, {"store_depths", false}}})
        .statistics;
  };
  constexpr std::int64_t kAll = 16 * 208 * 208;  // whole MCUs
  const RenderStatistics with_depths = decoded();
  EXPECT_GT(with_depths.pixels_decoded, 16 * 200 * 200 - 1);
  EXPECT_LE(with_depths.pixels_decoded, kAll);
  options.count_needed_pixels = true;
  const RenderStatistics of_view = decoded();
  EXPECT_GT(of_view.pixels_decoded, 0);
  EXPECT_LT(of_view.pixels_decoded, 2 * of_view.pixels_needed);
  EXPECT_GE(of_view.pixels_decoded, of_view.pixels_needed);
  EXPECT_LE(of_view.cameras_used, 16);
}

TEST_F(OutwardArrays, ARingOfPinholesShowsTheSceneAroundIt) {
  const store::Take take = write(ring_of_pinholes());
  ASSERT_TRUE(take.rig().looks_around());
  for (const VirtualCamera& view : views_within(true)) {
    expect_shows_the_scene(take, view, "focal_plane", {}, 0.03);
    expect_shows_the_scene(take, view, "aperture", {{"shape", std::string("hexagon")}}, 0.03);
    expect_shows_the_scene(take, view, "lumigraph", {}, 0.03);
  }
}

TEST_F(OutwardArrays, WeightsOfASyntheticApertureAreContinuous) {
  const store::Take take = write(sphere_of_fisheyes());
  const VirtualCamera view =
      virtual_camera_with_fov(64, 48, 60 * testing::kDegree, testing::make_pose({0, 0, 0}, 40, 5));
  LightFieldFrame instant;
  instant.rig = &take.rig();
  for (int i = 0; i < take.camera_count(); ++i) instant.included_cameras.push_back(i);
  const auto topology = std::make_shared<const rig::Topology>(
      rig::make_topology(take.rig(), instant.included_cameras));
  instant.present = instant.complete = topology;
  instant.frame_of_camera.assign(instant.included_cameras.size(), 0);
  const Method& method = aperture_method();
  const ApertureLens lens(view, instant, {0, 0, 1, kRadius},
                          {method.options(), {{"radius", 0.3}}, "aperture"});
  const RayCells cells(view, take.rig(), *topology);
  const auto weights_at = [&](double x, double y, int& index) {
    std::vector<double> weights;
    const auto crossing = cells.locate(x, y);
    if (!crossing) return weights;
    index = crossing->cell;
    const RayCells::Cell& cell = cells.cells()[crossing->cell];
    const ApertureLens::Plane plane = lens.plane_of(cell);
    for (const ApertureLens::Camera& camera : lens.cameras()) {
      weights.push_back(lens.weight(camera, plane, lens.place_of(cell, plane, *crossing)));
    }
    return weights;
  };
  int edges = 0;
  for (double y = 0.5; y < view.height; y += 4) {
    int before = -1;
    std::vector<double> last;
    for (double x = 0; x < view.width; x += 0.01) {
      int index = -1;
      const std::vector<double> weights = weights_at(x, y, index);
      ASSERT_FALSE(weights.empty());
      for (std::size_t i = 0; i < last.size(); ++i) ASSERT_NEAR(weights[i], last[i], 2e-3);
      edges += before >= 0 && index != before ? 1 : 0;
      before = index;
      last = weights;
    }
  }
  EXPECT_GT(edges, 10);
}

}  // namespace
}  // namespace raystage::render::outward_arrays_test
