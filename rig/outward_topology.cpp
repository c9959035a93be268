// SPDX-License-Identifier: Apache-2.0
// Builds the closed cells of an array that looks outwards, from its n camera centres (world,
// metres). A sphere's Delaunay triangulation is the convex hull of the directions; stereographic
// projection from one of them turns it into a Delaunay triangulation of the others in the plane,
// and the pole closes its border (Brown, "Voronoi diagrams from convex hulls", 1979). Output:
// triangles, or strips of a ring. Cost: O(n^2).
#include "rig/outward_topology.h"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <set>
#include <utility>
#include <vector>

#include "rig/array_plane.h"
#include "rig/camera_stations.h"
#include "rig/delaunay.h"

namespace raystage::rig {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

Vector3d mean_of(std::span<const Vector3d> vectors) {
  Vector3d sum = Vector3d::Zero();
  for (const Vector3d& vector : vectors) sum += vector - vectors[0];
  return vectors[0] + sum / static_cast<double>(vectors.size());
}

/// Returns the indices of the centres that do not coincide with an earlier one. Unlike those of an
/// ArrayPlane, centres behind one another differ.
std::vector<int> distinct_centres(std::span<const Vector3d> centres) {
  double extent = 0;
  for (const Vector3d& centre : centres) extent = std::max(extent, (centre - centres[0]).norm());
  std::vector<int> distinct;
  for (std::size_t i = 0; i < centres.size(); ++i) {
    const bool is_new = std::ranges::none_of(
        distinct, [&](int other) { return (centres[other] - centres[i]).norm() <= 1e-9 * extent; });
    if (is_new) distinct.push_back(static_cast<int>(i));
  }
  return distinct;
}

bool looks_outwards(std::span<const Vector3d> offsets, std::span<const Vector3d> directions) {
  constexpr double kAligned = 0.8, kOutwards = 0.5;
  double outwards = 0;
  for (std::size_t i = 0; i < offsets.size(); ++i) {
    const double length = offsets[i].norm();
    if (length > 0) outwards += directions[i].dot(offsets[i]) / length;
  }
  const auto count = static_cast<double>(offsets.size());
  return outwards > kOutwards * count && mean_of(directions).norm() < kAligned;
}

double smallest_spacing(std::span<const Vector3d> offsets, std::span<const int> stations) {
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < stations.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      least = std::min(least, (offsets[stations[i]] - offsets[stations[j]]).norm());
    }
  }
  return least;
}

/// Returns the unit normal of the plane that all offsets lie in, or nullopt. `stations`: the
/// indices of the offsets that stand for their station.
std::optional<Vector3d> common_plane(std::span<const Vector3d> offsets,
                                     std::span<const int> stations) {
  constexpr double kFlat = 0.1;  // of the smallest spacing
  Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
  for (const Vector3d& offset : offsets) spread += offset * offset.transpose();
  const Vector3d normal =
      Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(spread).eigenvectors().col(0);
  double least = 0, most = 0;
  for (const Vector3d& offset : offsets) {
    least = std::min(least, normal.dot(offset));
    most = std::max(most, normal.dot(offset));
  }
  if (most - least > kFlat * smallest_spacing(offsets, stations)) return std::nullopt;
  return normal;
}

/// Returns whether the offsets, in order about `normal`, are the corners of a convex polygon.
bool is_convex(std::span<const Vector3d> offsets, std::span<const int> order,
               const Vector3d& normal) {
  const std::size_t count = order.size();
  for (std::size_t i = 0; i < count; ++i) {
    const Vector3d& from = offsets[order[i]];
    const Vector3d& corner = offsets[order[(i + 1) % count]];
    const Vector3d& to = offsets[order[(i + 2) % count]];
    if (!((corner - from).cross(to - corner).dot(normal) > 0)) return false;
  }
  return true;
}

/// Returns the strips of a ring, or nullopt if the stations are not one ring, as those of two rings
/// or of a plate. Other cameras of a station are left out.
std::optional<Topology> ring_of_strips(std::span<const Vector3d> offsets,
                                       std::span<const int> stations, const Vector3d& normal) {
  const Vector3d across = normal.unitOrthogonal(), along = normal.cross(across);
  std::vector<int> order(stations.begin(), stations.end());
  std::ranges::sort(
      order, {}, [&](int i) { return std::atan2(offsets[i].dot(along), offsets[i].dot(across)); });
  if (!is_convex(offsets, order, normal)) return std::nullopt;
  Topology topology;
  topology.kind = Topology::Kind::kSegments;
  topology.normal = topology.up = normal;
  for (std::size_t i = 0; i < order.size(); ++i) {
    topology.cells.push_back({order[i], order[(i + 1) % order.size()], -1});
  }
  std::ranges::sort(topology.cells);
  return topology;
}

/// Returns the points, snapped to 2^-26 of their extent.
std::vector<GridPoint> snapped(std::span<const Vector2d> points) {
  double extent = 0;
  for (const Vector2d& point : points) extent = std::max(extent, point.cwiseAbs().maxCoeff());
  const double scale = std::ldexp(1.0, 25) / extent;
  std::vector<GridPoint> grid;
  for (const Vector2d& point : points) {
    grid.push_back({std::llround(point.x() * scale), std::llround(point.y() * scale)});
  }
  return grid;
}

/// Returns the triangles of a Delaunay triangulation of unit directions, counter-clockwise as seen
/// from outside; none if they do not surround the origin.
std::vector<Triangle> spherical_delaunay(std::span<const Vector3d> directions) {
  const Vector3d& pole = directions[0];
  const Vector3d across = pole.unitOrthogonal(), along = pole.cross(across);
  std::vector<Vector2d> points;
  for (std::size_t i = 1; i < directions.size(); ++i) {
    // 1 - cos of the angle to the pole, without cancellation.
    const double height = (directions[i] - pole).squaredNorm() / 2;
    points.emplace_back(directions[i].dot(across) / height, directions[i].dot(along) / height);
  }
  std::vector<Triangle> triangles;
  std::set<std::pair<int, int>> edges;
  for (const Triangle& flat : delaunay_triangulation(snapped(points))) {
    // The sphere is seen from its pole, that is, outside; points near the pole are far away, so
    // that the plane shows it mirrored.
    triangles.push_back({flat[0] + 1, flat[2] + 1, flat[1] + 1});
    const Triangle& t = triangles.back();
    for (std::size_t i = 0; i < 3; ++i) edges.insert({t[i], t[(i + 1) % 3]});
  }
  for (const auto& [from, to] : edges) {
    if (!edges.contains({to, from})) triangles.push_back({to, from, 0});
  }
  return triangles;
}

std::optional<Topology> closed_surface(std::span<const Vector3d> offsets) {
  constexpr double kSameDirection = 1e-3;  // radians; of cameras behind another, which are left out
  std::vector<Vector3d> directions;
  std::vector<int> kept;
  for (std::size_t i = 0; i < offsets.size(); ++i) {
    const Vector3d direction = offsets[i].normalized();
    const bool is_hidden = std::ranges::any_of(directions, [&](const Vector3d& other) {
      return (direction - other).norm() < kSameDirection;
    });
    if (is_hidden) continue;
    directions.push_back(direction);
    kept.push_back(static_cast<int>(i));
  }
  Topology topology;
  topology.kind = Topology::Kind::kTriangles;
  for (const Triangle& t : spherical_delaunay(directions)) {
    topology.cells.push_back(rotate_smallest_first({kept[t[0]], kept[t[1]], kept[t[2]]}));
  }
  if (topology.cells.empty()) return std::nullopt;
  std::ranges::sort(topology.cells);
  return topology;
}

}  // namespace

std::optional<Topology> outward_topology(std::span<const Vector3d> centres,
                                         std::span<const Vector3d> viewing_directions) {
  const ArrayPlane plane = fit_array_plane(centres, viewing_directions);
  if (plane.dimension < 2) return std::nullopt;
  const std::vector<int> distinct = distinct_centres(centres);
  std::vector<Vector3d> offsets, directions;
  for (const int index : distinct) {
    offsets.push_back(centres[index]);
    directions.push_back(viewing_directions[index]);
  }
  const Vector3d middle = mean_of(offsets);
  for (Vector3d& offset : offsets) offset -= middle;
  double extent = 0;
  for (const Vector3d& offset : offsets) extent = std::max(extent, offset.norm());
  const bool is_at_middle = std::ranges::any_of(
      offsets, [&](const Vector3d& offset) { return offset.norm() < 1e-3 * extent; });
  if (is_at_middle || !looks_outwards(offsets, directions)) return std::nullopt;

  std::optional<Topology> topology;
  const std::vector<int> stations = first_of_stations(offsets);
  if (const auto normal = common_plane(offsets, stations)) {
    topology = ring_of_strips(offsets, stations, *normal);
  } else if ((topology = closed_surface(offsets))) {
    topology->normal = plane.normal;
    topology->up = plane.up;
  }
  if (!topology) return std::nullopt;
  topology->outwards = true;
  for (Topology::Cell& cell : topology->cells) {
    for (int& corner : cell) {
      if (corner >= 0) corner = distinct[corner];
    }
  }
  return topology;
}

}  // namespace raystage::rig
