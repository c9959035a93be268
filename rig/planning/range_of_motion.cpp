// SPDX-License-Identifier: Apache-2.0
// Computes ranges of motion as intersections of half-spaces (thesis 5.2, figures 5-13 to 5-17). In
// the array's frame a ray from P with the slope m = (dx/-dz, dy/-dz) crosses the plane of the
// cameras at s = P_xy + P_z m. It was recorded if s is in the convex hull of the centres and m is a
// slope that the cameras see. With n.s <= c for an edge of the hull, P satisfies
//   n.P_xy + (n.m) P_z <= c,
// one half-space for each edge and extreme ray. The slopes of all rays of a view are in the convex
// hull of those of its corners, and so are the crossings, so that the corners decide. A ray to Q
// crosses at s = (P_xy Q_z - Q_xy P_z) / (Q_z - P_z), which gives half-spaces likewise. Input: h
// edges and r rays; cost: O(h r) half-spaces.
#include "rig/planning/range_of_motion.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>

namespace raystage::rig {
namespace {

constexpr double kDegreesPerRadian = 57.29577951308232;

/// The border of the array: outward normals and offsets of the hull's edges, n.s <= c. Those of a
/// row bound its line at both ends.
struct Edge {
  Eigen::Vector2d normal;
  double offset = 0;
};

std::vector<Edge> edges_of(const std::vector<Eigen::Vector2d>& hull) {
  std::vector<Edge> edges;
  if (hull.size() == 2) {
    const Eigen::Vector2d along = (hull[1] - hull[0]).normalized();
    return {{-along, -along.dot(hull[0])}, {along, along.dot(hull[1])}};
  }
  for (std::size_t i = 0; i < hull.size(); ++i) {
    const Eigen::Vector2d side = hull[(i + 1) % hull.size()] - hull[i];
    const Eigen::Vector2d normal = Eigen::Vector2d(side.y(), -side.x()).normalized();
    edges.push_back({normal, normal.dot(hull[i])});
  }
  return edges;
}

/// Returns half-spaces that hold the plane through a row along the viewing direction.
std::vector<HalfSpace> plane_of_row(const std::vector<Eigen::Vector2d>& hull) {
  const Eigen::Vector2d along = (hull[1] - hull[0]).normalized();
  const Eigen::Vector3d across(-along.y(), along.x(), 0);
  const double offset = across.head<2>().dot(hull[0]);
  return {{across, offset}, {-across, -offset}};
}

double extent_of(const std::vector<Eigen::Vector2d>& hull) {
  double extent = 0;
  for (const Eigen::Vector2d& corner : hull) extent = std::max(extent, corner.norm());
  return extent;
}

/// Returns how far from the plane of the cameras a view may be at most: its outermost rays must
/// cross the array between its ends, along each edge's normal.
double farthest_depth(const std::vector<Edge>& edges, const std::vector<Eigen::Vector2d>& hull,
                      const std::vector<Eigen::Vector2d>& slopes) {
  double farthest = std::numeric_limits<double>::infinity();
  for (const Edge& edge : edges) {
    double least = edge.offset, smallest = std::numeric_limits<double>::infinity();
    double largest = -smallest;
    for (const Eigen::Vector2d& corner : hull) least = std::min(least, edge.normal.dot(corner));
    for (const Eigen::Vector2d& slope : slopes) {
      smallest = std::min(smallest, edge.normal.dot(slope));
      largest = std::max(largest, edge.normal.dot(slope));
    }
    if (largest > smallest) {
      farthest = std::min(farthest, (edge.offset - least) / (largest - smallest));
    }
  }
  return farthest;
}

RangeOfMotion no_position(std::string because) {
  return {ConvexPolyhedron(), 3, std::move(because)};
}

}  // namespace

RangeOfMotion range_of_motion(const WallEyedArray& array, const ViewFrustum& frustum) {
  const Eigen::Matrix3d array_from_view =
      array.pose.world_from_camera_rotation.transpose() * frustum.world_from_camera_rotation;
  std::vector<Eigen::Vector2d> slopes;
  for (const Eigen::Vector2d& corner : frustum.slopes.corners()) {
    const Eigen::Vector3d ray = array_from_view * Eigen::Vector3d(corner.x(), corner.y(), -1);
    if (!(ray.z() < 0)) return no_position("the view looks past the side or the back of the array");
    slopes.emplace_back(ray.head<2>() / -ray.z());
    if (!array.slopes.contains(slopes.back())) {
      const Eigen::Vector2d angles(std::atan(slopes.back().x()), std::atan(slopes.back().y()));
      return no_position(fmt::format(
          "a corner of the view points {:.2f} deg {} and {:.2f} deg {}, which no camera sees",
          std::abs(angles.x()) * kDegreesPerRadian, angles.x() < 0 ? "to the left" : "to the right",
          std::abs(angles.y()) * kDegreesPerRadian, angles.y() < 0 ? "down" : "up"));
    }
  }
  const Eigen::Vector3d half_base = array_from_view * Eigen::Vector3d(frustum.interaxial / 2, 0, 0);
  if (array.hull.size() == 1) {
    if (frustum.interaxial != 0) return no_position("a single position has no room for two eyes");
    return {ConvexPolyhedron(Eigen::Vector3d(0, 0, 0)), 0, ""};
  }
  const std::vector<Edge> edges = edges_of(array.hull);
  std::vector<HalfSpace> half_spaces;
  double steepest = 0;
  for (const Eigen::Vector2d& slope : slopes) {
    steepest = std::max(steepest, slope.cwiseAbs().maxCoeff());
    for (const Edge& edge : edges) {
      const Eigen::Vector3d normal(edge.normal.x(), edge.normal.y(), edge.normal.dot(slope));
      // Both eyes: the tighter one counts.
      half_spaces.push_back(half_space(normal, edge.offset - std::abs(normal.dot(half_base))));
    }
  }
  const bool is_row = array.hull.size() == 2;
  if (is_row) {
    constexpr double kInPlane = 1e-9;  // of the distance between the eyes
    for (const HalfSpace& side : plane_of_row(array.hull)) {
      if (std::abs(side.normal.dot(half_base)) > kInPlane * half_base.norm()) {
        return no_position("the eyes are not in the plane of the row");
      }
      half_spaces.push_back(side);
    }
  }
  const double depth = farthest_depth(edges, array.hull, slopes);
  const double extent = 2 * (extent_of(array.hull) + depth * std::max(1.0, steepest));
  RangeOfMotion range{ConvexPolyhedron(half_spaces, extent), is_row ? 2 : 3, ""};
  if (range.positions.is_empty()) {
    range.empty_because =
        fmt::format("the eyes are {:.4g} m apart, which the array cannot hold", frustum.interaxial);
  }
  return range;
}

RangeOfMotion range_of_motion_around(const WallEyedArray& array,
                                     std::span<const Eigen::Vector3d> subject, double farthest) {
  assert(std::isfinite(farthest) && farthest > 0);
  if (subject.empty()) return no_position("there is no subject");
  if (array.hull.size() < 3) return no_position("the array is a row or a single camera");
  const std::vector<Edge> edges = edges_of(array.hull);
  std::vector<HalfSpace> half_spaces{{Eigen::Vector3d::UnitZ(), farthest}};
  double extent = extent_of(array.hull) + farthest;
  for (const Eigen::Vector3d& q : subject) {
    if (!(q.z() < 0)) return no_position("a part of the subject is not in front of the array");
    extent = std::max(extent, q.norm());
    half_spaces.push_back({-Eigen::Vector3d::UnitZ(), -q.z()});  // P_z >= Q_z
    for (const Edge& edge : edges) {
      // n.(P_xy Q_z - Q_xy P_z) <= c (Q_z - P_z) for P_z > Q_z changes its sign: Q_z - P_z < 0.
      const Eigen::Vector3d normal(-q.z() * edge.normal.x(), -q.z() * edge.normal.y(),
                                   edge.normal.dot(q.head<2>()) - edge.offset);
      half_spaces.push_back(half_space(normal, -edge.offset * q.z()));
    }
    // The slope (Q - P)_xy / (P_z - Q_z) is one that the cameras see.
    for (int axis = 0; axis < 2; ++axis) {
      Eigen::Vector3d normal = Eigen::Vector3d::Zero();
      normal(axis) = -1;
      normal.z() = -array.slopes.largest(axis);
      half_spaces.push_back(half_space(normal, -q(axis) - array.slopes.largest(axis) * q.z()));
      normal(axis) = 1;
      normal.z() = array.slopes.least(axis);
      half_spaces.push_back(half_space(normal, q(axis) + array.slopes.least(axis) * q.z()));
    }
  }
  double steepest = 1;
  steepest = std::max({steepest, array.slopes.least.cwiseAbs().maxCoeff(),
                       array.slopes.largest.cwiseAbs().maxCoeff()});
  RangeOfMotion range{ConvexPolyhedron(half_spaces, 4 * extent * steepest), 3, ""};
  if (range.positions.is_empty()) {
    range.empty_because = "no position sees the whole subject through the array";
  }
  return range;
}

}  // namespace raystage::rig
