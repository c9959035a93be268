// SPDX-License-Identifier: Apache-2.0
#include "render/depth/depth_surface.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>

#include "base/error.h"
#include "base/transfer_function.h"
#include "render/common/ray_cells.h"
#include "render/renderer.h"
#include "testing/render/synthetic_take.h"

namespace raystage::render::depth_surface_test {
namespace {

using Eigen::Vector3d;

constexpr double kDegree = std::numbers::pi / 180;
constexpr double kRadius = 0.5, kWall = 6;
const Vector3d kMiddle(0.1, 0, -3);

/// Returns the distance along a ray (units of `direction`) to a sphere 3 m away in front of a wall
/// 6 m away.
double distance_to_scene(const Vector3d& origin, const Vector3d& direction) {
  const double a = direction.squaredNorm(), b = (kMiddle - origin).dot(direction);
  const double c = (kMiddle - origin).squaredNorm() - kRadius * kRadius;
  const double root = b * b - a * c;
  if (root > 0 && b - std::sqrt(root) > 0) return (b - std::sqrt(root)) / a;
  return (-kWall - origin.z()) / direction.z();
}

rig::Rig grid_rig() {
  schemas::RigDocument document;
  document.name = "grid";
  for (const schemas::CameraGeometry& camera : testing::camera_grid(4, 4, 0.08, 160, 120)) {
    document.cameras.push_back({camera, {}});
  }
  return rig::rig_from_document(document);
}

std::shared_ptr<CameraDepths> true_depths(const rig::Rig& rig) {
  auto depths = std::make_shared<CameraDepths>();
  for (const rig::Rig::Camera& camera : rig.cameras) {
    const VirtualCamera pinhole = undistorted(camera.model, camera.pose);
    InverseDepthMap map(pinhole.width, pinhole.height);
    const Eigen::Matrix3d ray_from_pixel = world_ray_from_pixel(pinhole);
    for (int y = 0; y < map.height; ++y) {
      for (int x = 0; x < map.width; ++x) {
        const Vector3d ray = ray_from_pixel * Vector3d(x + 0.5, y + 0.5, 1);  // planar depth 1
        map.at(x, y) = static_cast<float>(1 / distance_to_scene(pinhole.pose.position, ray));
      }
    }
    depths->pinholes.push_back(pinhole);
    depths->maps.push_back(std::move(map));
  }
  return depths;
}

double inverse_distance(const RaySurface& surface, const WorldRay& ray) {
  double inverse = -1;
  surface({&ray, 1}, {&inverse, 1});
  return inverse;
}

/// Numbers of rays of a view, and of rays whose error exceeds what a camera's pixel resolves.
struct Score {
  int wrong = 0, all = 0;
};
Score score(const RaySurface& surface, const VirtualCamera& view) {
  Score result;
  const Eigen::Matrix3d ray_from_pixel = world_ray_from_pixel(view);
  for (int y = 0; y < view.height; ++y) {
    for (int x = 0; x < view.width; ++x) {
      const WorldRay ray{view.pose.position,
                         (ray_from_pixel * Vector3d(x + 0.5, y + 0.5, 1)).normalized()};
      const double truth = 1 / distance_to_scene(ray.origin, ray.direction);
      const double found = inverse_distance(surface, ray);
      ++result.all;
      // Within the inverse depth that moves a point half a pixel between cameras 0.24 m apart.
      result.wrong += std::abs(found - truth) < 0.5 / (0.24 * 130) ? 0 : 1;
    }
  }
  return result;
}

rig::Pose at(const Vector3d& position, double yaw_degrees) {
  rig::Pose pose;
  pose.position = position;
  pose.world_from_camera_rotation =
      Eigen::AngleAxisd(yaw_degrees * kDegree, Vector3d::UnitY()).toRotationMatrix();
  return pose;
}

TEST(DepthSurface, RaysMeetTheSceneFromEverywhere) {
  const rig::Rig rig = grid_rig();
  const RaySurface surface = depth_surface(true_depths(rig), rig, {2.3, 6.2});
  for (const auto& [position, yaw] : {std::pair{Vector3d(0.01, 0.02, 0), 0.0},
                                      {Vector3d(0, 0, 1.5), 0.0},
                                      {Vector3d(0.1, 0, -1), 0.0},
                                      {Vector3d(0.5, 0.1, 0.1), 12.0}}) {
    const Score found =
        score(surface, virtual_camera_with_fov(64, 48, 30 * kDegree, at(position, yaw)));
    // Edges of the sphere are a pixel wide, and depths hidden from all cameras are undefined.
    EXPECT_LT(found.wrong, 0.04 * found.all) << position.transpose();
  }
}

TEST(DepthSurface, ARayComesOutOfTheSpheresShadow) {
  // The ray starts behind the sphere, hidden from all cameras, and ends on the visible wall.
  const rig::Rig rig = grid_rig();
  const RaySurface surface = depth_surface(true_depths(rig), rig, {2.3, 6.2});
  const WorldRay slanting{Vector3d(0.1, 0, -3.7), Vector3d(2.1, 0, -2.3).normalized()};
  const double truth = 1 / distance_to_scene(slanting.origin, slanting.direction);
  EXPECT_NEAR(inverse_distance(surface, slanting), truth, 0.05 * truth);
}

TEST(DepthSurface, RaysThatMissTheSceneMeetNothing) {
  const rig::Rig rig = grid_rig();
  const RaySurface surface = depth_surface(true_depths(rig), rig, {2.3, 6.2});
  EXPECT_TRUE(std::isnan(inverse_distance(surface, {Vector3d::Zero(), Vector3d::UnitZ()})));
  EXPECT_TRUE(std::isnan(inverse_distance(surface, {Vector3d::Zero(), Vector3d::UnitX()})));
  EXPECT_TRUE(std::isnan(inverse_distance(surface, {Vector3d(0, 0, -8), -Vector3d::UnitZ()})));
  // No camera sees this ray: it ends at the far end of the scene.
  const WorldRay beside{Vector3d(30, 0, 0), -Vector3d::UnitZ()};
  EXPECT_NEAR(inverse_distance(surface, beside), 1 / 6.2, 1e-12);
  // A scene with an infinite far end, and a rig without cameras.
  const RaySurface endless =
      depth_surface(true_depths(rig), rig, {2.3, std::numeric_limits<double>::infinity()});
  EXPECT_EQ(inverse_distance(endless, beside), 0);
  const RaySurface blind = depth_surface(std::make_shared<CameraDepths>(), rig, {2.3, 6.2});
  EXPECT_NEAR(inverse_distance(blind, {Vector3d::Zero(), -Vector3d::UnitZ()}), 1 / 6.2, 1e-12);
}

TEST(DepthSurface, AnyRayGetsANumberOrNone) {
  const rig::Rig rig = grid_rig();
  const RaySurface surface = depth_surface(true_depths(rig), rig, {2.3, 6.2});
  std::mt19937 random(20051);
  std::normal_distribution<double> any;
  for (int i = 0; i < 20'000; ++i) {
    const double scale = std::pow(10, 3 * any(random));
    const WorldRay ray{scale * Vector3d(any(random), any(random), any(random)),
                       Vector3d(any(random), any(random), any(random)).normalized()};
    const double found = inverse_distance(surface, ray);
    ASSERT_TRUE(std::isnan(found) || (found >= 0 && found <= 4 / 2.3)) << i;
  }
}

TEST(DepthProxy, MakesTheLumigraphSharpAtEveryDepth) {
  testing::TestFolder folder;
  testing::SyntheticTake settings;
  settings.cameras = testing::camera_grid(3, 3, 0.2, 120, 90);
  settings.depth_range = schemas::DepthRange{2.3, 6.2};
  settings.scene = [](const Vector3d& origin, const Vector3d& direction) {
    const Vector3d p = origin + distance_to_scene(origin, direction) * direction;
    const double wave = std::sin(p.x() * 14 + std::sin(p.y() * 9)) * std::cos(p.y() * 12);
    return std::array<double, 3>{0.3 + 0.2 * wave, p.z() > -4 ? 0.6 : 0.25, 0.35 - 0.2 * wave};
  };
  write_synthetic_take(settings, folder.path() / "take");
  const store::Take take(folder.path() / "take");
  const VirtualCamera view = virtual_camera_with_fov(100, 75, 40 * kDegree, at({0.03, 0.02, 0}, 0));
  const auto error_of = [&](const char* method, const schemas::OptionValues& options,
                            bool reference) {
    RendererOptions renderer;
    renderer.reference = reference;
    const RenderedView image =
        LightFieldRenderer(take, renderer)
            .render(view, store::select_frames(take, 0, 1'000'000),
                    {method, rig::fronto_parallel_plane(take.rig(), 4), options});
    const Eigen::Matrix3d ray_from_pixel = world_ray_from_pixel(view);
    double squares = 0;
    for (int y = 0; y < view.height; ++y) {
      for (int x = 0; x < view.width; ++x) {
        const auto truth =
            settings.scene(view.pose.position, ray_from_pixel * Vector3d(x + 0.5, y + 0.5, 1));
        for (std::size_t c = 0; c < 3; ++c) {
          const auto at_pixel = static_cast<std::size_t>(4 * (y * view.width + x));
          const double off =
              255 * (srgb_from_linear(static_cast<double>(image.rgba[at_pixel + c])) -
                     srgb_from_linear(truth[c]));
          squares += off * off;
        }
      }
    }
    return std::sqrt(squares / (3.0 * view.width * view.height));
  };
  const schemas::OptionValues by_depth{{"proxy", std::string("depth")}};
  const double on_plane = error_of("lumigraph", {}, false);
  const double on_depth = error_of("lumigraph", by_depth, false);
  EXPECT_LT(on_depth, 0.85 * on_plane);
  EXPECT_LT(on_depth, 1.3 * error_of("depth", {}, false));  // the accuracy that these depths allow
  EXPECT_NEAR(error_of("lumigraph", by_depth, true), on_depth, 0.05 * on_depth);
}

}  // namespace
}  // namespace raystage::render::depth_surface_test
