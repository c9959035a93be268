// SPDX-License-Identifier: Apache-2.0
// The measured ranges of real rigs against a million random rays that are traced one by one.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <random>
#include <vector>

#include "planning/complete_topology.h"
#include "planning/coverage_plan.h"
#include "render/common/ray_cells.h"
#include "testing/render/synthetic_take.h"
#include "testing/render/test_poses.h"

namespace raystage::planning::coverage_rays_test {
namespace {

using Eigen::Vector3d;
using testing::kDegree;

/// 4 x 4 cameras with lens distortion, none where or turned as it should be.
rig::Rig real_rig(std::mt19937& random) {
  std::uniform_real_distribution<double> any(-1, 1);
  schemas::RigDocument document;
  for (const auto& camera : testing::camera_grid(4, 4, 0.06, 640, 480, {-0.15, 0.03, 0, 0, 0})) {
    document.cameras.push_back({camera, {}});
  }
  rig::Rig rig = rig::rig_from_document(document);
  for (rig::Rig::Camera& camera : rig.cameras) {
    camera.pose.position += 0.004 * Vector3d(any(random), any(random), any(random));
    camera.pose.world_from_camera_rotation =
        testing::make_pose(Vector3d::Zero(), 3 * any(random), 2 * any(random))
            .world_from_camera_rotation;
  }
  return rig;
}

double distance_from_triangle(const Vector3d& p, const Vector3d& a, const Vector3d& b,
                              const Vector3d& c) {
  const auto from_segment = [&](const Vector3d& from, const Vector3d& to) {
    const Vector3d along = to - from;
    const double share =
        std::clamp(along.dot(p - from) / std::max(1e-300, along.squaredNorm()), 0.0, 1.0);
    return (p - from - share * along).norm();
  };
  const Vector3d normal = (b - a).cross(c - a);
  const double squared = normal.squaredNorm();
  if (squared > 0) {
    const double u = (b - a).cross(p - a).dot(normal), v = (c - b).cross(p - b).dot(normal),
                 w = (a - c).cross(p - c).dot(normal);
    if (u >= 0 && v >= 0 && w >= 0) return std::abs((p - a).dot(normal)) / std::sqrt(squared);
  }
  return std::min({from_segment(a, b), from_segment(b, c), from_segment(c, a)});
}

/// Returns the distance of a point from a closed surface: above 0 inside.
double signed_distance(const ClosedSurface& surface, const Vector3d& p) {
  double nearest = INFINITY, solid_angle = 0;
  for (const auto& t : surface.triangles) {
    const Vector3d &a = surface.vertices[t[0]], &b = surface.vertices[t[1]],
                   &c = surface.vertices[t[2]];
    nearest = std::min(nearest, distance_from_triangle(p, a, b, c));
    const Vector3d u = (a - p).normalized(), v = (b - p).normalized(), w = (c - p).normalized();
    solid_angle += 2 * std::atan2(u.dot(v.cross(w)), 1 + u.dot(v) + v.dot(w) + w.dot(u));
  }
  return solid_angle > 2 * std::numbers::pi ? nearest : -nearest;
}

/// Traces rays as far as the horizon.
class Tracer {
 public:
  Tracer(const rig::Rig& rig, const render::VirtualCamera& view)
      : rig_(rig), view_(view), topology_(complete_topology(rig)), cells_(view, rig, topology_) {}

  bool is_recorded(double x, double y) const {
    const auto crossing = cells_.locate(x, y);
    if (!crossing) return false;
    const schemas::Intrinsics& k = view_.intrinsics;
    const Vector3d ray =
        view_.pose.world_from_camera_rotation * Vector3d((x - k.cx) / k.fx, -(y - k.cy) / k.fy, -1);
    const auto& cell = cells_.cells()[crossing->cell];
    return std::any_of(cell.camera.begin(), cell.camera.begin() + cell.count, [&](int index) {
      const rig::Rig::Camera& camera = rig_.cameras[index];
      const auto pixel =
          camera.model.project(camera.pose.world_from_camera_rotation.transpose() * ray);
      return pixel && pixel->x() >= 0 && pixel->y() >= 0 && pixel->x() <= camera.model.width() &&
             pixel->y() <= camera.model.height();
    });
  }

 private:
  const rig::Rig& rig_;
  render::VirtualCamera view_;
  rig::Topology topology_;
  render::RayCells cells_;
};

TEST(CoverageRays, NoneOfAMillionDisagreesByMoreThanAMillimetre) {
  std::mt19937 random(20051);
  std::uniform_real_distribution<double> any(-1, 1), unit(0, 1);
  const rig::Rig rig = real_rig(random);
  CoverageOptions options;
  options.view_fov_deg = {35};
  options.shares = {1};
  const CoveragePlan plan = plan_coverage("real", rig, options);
  const CoverageVolume& volume = plan.volumes[0];
  ASSERT_FALSE(volume.is_exact);
  EXPECT_LE(volume.error_m, 1e-3);
  render::VirtualCamera view = render::virtual_camera_with_fov(1024, 768, 35 * kDegree, {});
  view.pose.world_from_camera_rotation = plan.array.world_from_camera_rotation;
  const Eigen::Vector3d half = volume.extent() / 2;
  constexpr double kMillimetre = 1e-3;
  constexpr int kPositions = 2000, kRays = 500;
  long traced = 0;
  int inside = 0, outside = 0;
  double worst_outside = 0;
  for (int i = 0; i < kPositions; ++i) {
    // Half of the positions are near the surface.
    Vector3d position;
    if (i % 2 == 0) {
      const auto& t = volume.surface.triangles[random() % volume.surface.triangles.size()];
      double u = unit(random), v = unit(random);
      if (u + v > 1) u = 1 - u, v = 1 - v;
      position = (1 - u - v) * volume.surface.vertices[t[0]] + u * volume.surface.vertices[t[1]] +
                 v * volume.surface.vertices[t[2]] +
                 4 * kMillimetre * Vector3d(any(random), any(random), any(random));
    } else {
      position = 1.2 * half.cwiseProduct(Vector3d(any(random), any(random), any(random)));
    }
    view.pose.position = plan.array.world_from_camera(position);
    const Tracer tracer(rig, view);
    const double distance = signed_distance(volume.surface, position);
    bool all = true;
    for (int ray = 0; ray < kRays; ++ray) {
      // The first rays to be lost are at the border of the picture.
      double x = unit(random), y = unit(random);
      if (ray < 16 || ray % 4 == 0) x = std::round(x);
      if (ray < 16 || ray % 4 == 2) y = std::round(y);
      x *= view.width;
      y *= view.height;
      all = tracer.is_recorded(x, y) && all;
      ++traced;
    }
    if (distance > kMillimetre) {
      ++inside;
      EXPECT_TRUE(all) << position.transpose() << " is " << distance << " m inside";
    }
    outside += distance < -kMillimetre ? 1 : 0;
    if (all) worst_outside = std::max(worst_outside, -distance);
  }
  EXPECT_GE(traced, 1'000'000);
  EXPECT_GT(inside, 200);
  EXPECT_GT(outside, 200);
  EXPECT_LE(worst_outside, kMillimetre);
}

}  // namespace
}  // namespace raystage::planning::coverage_rays_test
