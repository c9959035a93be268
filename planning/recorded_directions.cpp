// SPDX-License-Identifier: Apache-2.0
// Measures in which directions from a point rays were recorded: the sides of a cube around it are
// pictures of 90 degrees, whose parts are measured by solid angle (recorded_part.h). Of a ring, the
// four sides have one row in its plane. Input: a point (world), rig, topology. Output: shares, 0 to
// 1. Cost: that of six views.
#include "planning/recorded_directions.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>
#include <set>
#include <vector>

#include "planning/recorded_part.h"
#include "render/common/ray_cells.h"
#include "rig/planning/wall_eyed_array.h"

namespace raystage::planning {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;

const Eigen::Vector4d kInfinity(0, 0, 0, 1);  // a plane
constexpr int kSide = 1024;                   // pixels; shares do not depend on it

bool is_ring(const rig::Topology& topology) {
  return topology.kind == rig::Topology::Kind::kSegments;
}

/// Returns the sides of a cube, turned so that those of a ring are perpendicular to its plane.
std::vector<Matrix3d> cube_sides(const rig::Topology& topology) {
  const Matrix3d upright =
      is_ring(topology)
          ? Eigen::Quaterniond::FromTwoVectors(Vector3d::UnitY(), topology.up).toRotationMatrix()
          : Matrix3d::Identity();
  std::vector<Matrix3d> sides;
  constexpr double kQuarter = std::numbers::pi / 2;
  for (int side = 0; side < 4; ++side) {
    sides.emplace_back(upright * Eigen::AngleAxisd(side * kQuarter, Vector3d::UnitY()));
  }
  if (is_ring(topology)) return sides;
  for (const double turn : {-kQuarter, kQuarter}) {
    sides.emplace_back(upright * Eigen::AngleAxisd(turn, Vector3d::UnitX()));
  }
  return sides;
}

std::optional<FocalSphere> sphere_of(const Viewpoint& from, const rig::Rig& rig,
                                     const Matrix3d& ray_from_pixel) {
  if (std::isinf(from.focal_depth)) return std::nullopt;
  return FocalSphere{rig.centre(), from.focal_depth, from.position, ray_from_pixel};
}

/// Returns the unrecorded share, or any larger number where it is more than `precision.enough`.
double unrecorded(const Viewpoint& from, const rig::Rig& rig, const rig::Topology& topology,
                  Precision precision) {
  const std::vector<Matrix3d> sides = cube_sides(topology);
  const auto count = static_cast<double>(sides.size());
  const double enough = precision.enough * count;  // of all sides
  double missing = 0;
  for (const Matrix3d& side : sides) {
    RayBundle rays;
    rays.view = render::virtual_camera_with_fov(kSide, is_ring(topology) ? 1 : kSide,
                                                std::numbers::pi / 2, {});
    rays.view.pose = {side, from.position};
    const Matrix3d ray_from_pixel = render::world_ray_from_pixel(rays.view);
    rays.measure = Measure::solid_angle(ray_from_pixel, is_ring(topology) ? 6 : 3);
    rays.sphere = sphere_of(from, rig, ray_from_pixel);
    precision.enough = enough - missing;
    missing += unrecorded_part(rays, rig, topology, kInfinity, precision);
    if (missing > enough) break;
  }
  return missing / count;
}

/// Calls visit(direction) with directions that are spread evenly, on a golden spiral.
template <class Visit>
void visit_all_directions(int count, const Visit& visit) {
  for (int i = 0; i < count; ++i) {
    const double height = 1 - 2 * (i + 0.5) / count;
    const double turn = i * std::numbers::pi * (3 - std::sqrt(5.0));
    const double radius = std::sqrt(1 - height * height);
    visit(Vector3d(radius * std::cos(turn), height, radius * std::sin(turn)));
  }
}

/// As that; of a ring with directions in its plane.
template <class Visit>
void visit_directions(const rig::Topology& topology, int count, const Visit& visit) {
  if (!is_ring(topology)) return visit_all_directions(count, visit);
  const Matrix3d upright = cube_sides(topology).front();
  for (int i = 0; i < count; ++i) {
    const double turn = 2 * std::numbers::pi * (i + 0.5) / count;
    visit(Vector3d(upright * Vector3d(std::cos(turn), 0, std::sin(turn))));
  }
}

/// Returns whether a camera sees what is in focus in a direction.
class CameraTest {
 public:
  CameraTest(const Viewpoint& from, const rig::Rig& rig) : from_(from), rig_(rig) {
    sphere_ = sphere_of(from, rig, Matrix3d::Identity());
  }

  bool sees(int index, const Vector3d& direction) const {
    const rig::Rig::Camera& camera = rig_.cameras[index];
    Vector3d in_camera = camera.pose.world_from_camera_rotation.transpose() * direction;
    if (sphere_) {
      const auto point = sphere_->point_at(direction);
      if (!point) return false;
      in_camera = camera.pose.camera_from_world(*point);
    }
    const auto pixel = camera.model.project(in_camera);
    return pixel && camera.model.contains(*pixel);
  }

 private:
  const Viewpoint& from_;
  const rig::Rig& rig_;
  std::optional<FocalSphere> sphere_;
};

}  // namespace

double unrecorded_directions(const Viewpoint& from, const rig::Rig& rig,
                             const rig::Topology& topology) {
  return unrecorded(from, rig, topology, {});
}

bool are_directions_recorded(const Viewpoint& from, const rig::Rig& rig,
                             const rig::Topology& topology, double share) {
  constexpr double kBend = 5e-4;
  const double most_missing = 1 - share;
  return unrecorded(from, rig, topology, {kBend, most_missing}) <= most_missing + 1e-12;
}

double unseen_directions(const Viewpoint& from, const rig::Rig& rig,
                         const rig::Topology& topology) {
  std::set<int> present;
  for (const rig::Topology::Cell& cell : topology.cells) {
    for (const int camera : cell) {
      if (camera >= 0) present.insert(camera);
    }
  }
  constexpr int kDirections = 4096;
  const CameraTest test(from, rig);
  int missing = 0;
  visit_all_directions(kDirections, [&](const Vector3d& direction) {
    const bool is_seen =
        std::ranges::any_of(present, [&](int camera) { return test.sees(camera, direction); });
    missing += is_seen ? 0 : 1;
  });
  return static_cast<double>(missing) / kDirections;
}

bool is_body_recorded(const Vector3d& position, std::span<const Vector3d> corners,
                      const rig::Rig& rig, const rig::Topology& topology) {
  Vector3d middle = Vector3d::Zero();
  for (const Vector3d& corner : corners) middle += corner / static_cast<double>(corners.size());
  const Vector3d ahead = middle - position;
  double radius = 0;
  for (const Vector3d& corner : corners) radius = std::max(radius, (corner - middle).norm());
  if (ahead.norm() <= radius) return false;
  RayBundle rays;
  rays.view = render::virtual_camera_with_fov(kSide, kSide, std::numbers::pi / 2, {});
  rays.view.pose = {
      Eigen::Quaterniond::FromTwoVectors(-Vector3d::UnitZ(), ahead.normalized()).toRotationMatrix(),
      position};
  // The picture holds the sphere around the body.
  const double slope = radius / std::sqrt(ahead.squaredNorm() - radius * radius);
  rays.view.intrinsics.fx = rays.view.intrinsics.fy = kSide / 2.0 / slope;
  std::vector<Vector2d> outline;
  for (const Vector3d& corner : corners) {
    const Vector3d at = rays.view.pose.camera_from_world(corner);
    outline.emplace_back(rays.view.intrinsics.cx + rays.view.intrinsics.fx * at.x() / -at.z(),
                         rays.view.intrinsics.cy - rays.view.intrinsics.fy * at.y() / -at.z());
  }
  for (const Vector2d& corner : rig::convex_hull(outline, 0)) rays.picture.add(corner);
  constexpr double kBend = 5e-4;
  return unrecorded_part(rays, rig, topology, kInfinity, {kBend, 0}) == 0;
}

double unrecorded_directions_reference(const Viewpoint& from, const rig::Rig& rig,
                                       const rig::Topology& topology, int count) {
  const CameraTest test(from, rig);
  int missing = 0;
  visit_directions(topology, count, [&](const Vector3d& direction) {
    render::VirtualCamera view = render::virtual_camera_with_fov(2, 2, 1, {});
    view.pose = {
        Eigen::Quaterniond::FromTwoVectors(-Vector3d::UnitZ(), direction).toRotationMatrix(),
        from.position};
    const render::RayCells cells(view, rig, topology);
    const auto crossing = cells.locate(1, 1);
    if (!crossing) {
      ++missing;
      return;
    }
    const render::RayCells::Cell& cell = cells.cells()[crossing->cell];
    const bool is_seen = std::any_of(cell.camera.begin(), cell.camera.begin() + cell.count,
                                     [&](int camera) { return test.sees(camera, direction); });
    missing += is_seen ? 0 : 1;
  });
  return static_cast<double>(missing) / count;
}

}  // namespace raystage::planning
