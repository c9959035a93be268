// SPDX-License-Identifier: Apache-2.0
// Intersects half-spaces by clipping the faces of a box one half-space after the other (Sutherland
// and Hodgman, "Reentrant polygon clipping", 1974, for each face). Vertices that several planes
// share are computed once. At the end each vertex is solved again from the planes that meet in it,
// so that it does not carry the rounding of the box. Input: n half-spaces; output: vertices and
// faces. Cost: O(n * faces).
#include "rig/planning/convex_polyhedron.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>
#include <map>
#include <utility>

namespace raystage::rig {
namespace {

constexpr double kOnPlane = 1e-13;  // of the extent

using Polygon = std::vector<int>;

/// Returns the vertices of a convex polygon in counter-clockwise order about `normal`.
Polygon ordered_about(const std::vector<Eigen::Vector3d>& vertices, Polygon polygon,
                      const Eigen::Vector3d& normal) {
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  for (const int v : polygon) centre += vertices[v] / static_cast<double>(polygon.size());
  const Eigen::Vector3d x = normal.unitOrthogonal(), y = normal.cross(x);
  const auto angle = [&](int v) {
    const Eigen::Vector3d from_centre = vertices[v] - centre;
    return std::atan2(from_centre.dot(y), from_centre.dot(x));
  };
  std::ranges::sort(polygon, {}, angle);
  return polygon;
}

/// Returns the point where planes meet, nearest to `guess` where they do not determine it.
Eigen::Vector3d meeting_point(const std::vector<const HalfSpace*>& planes,
                              const Eigen::Vector3d& guess) {
  Eigen::MatrixXd normals(planes.size(), 3);
  Eigen::VectorXd distances(planes.size());
  for (std::size_t i = 0; i < planes.size(); ++i) {
    normals.row(static_cast<Eigen::Index>(i)) = planes[i]->normal.transpose();
    distances(static_cast<Eigen::Index>(i)) = planes[i]->depth_of(guess);
  }
  return guess + normals.completeOrthogonalDecomposition().solve(distances);
}

/// Returns the point of a triangle that is nearest to `p` (Ericson, "Real-Time Collision
/// Detection", 2004, section 5.1.5).
Eigen::Vector3d nearest_in_triangle(const Eigen::Vector3d& p, const Eigen::Vector3d& a,
                                    const Eigen::Vector3d& b, const Eigen::Vector3d& c) {
  const Eigen::Vector3d ab = b - a, ac = c - a, ap = p - a, bp = p - b, cp = p - c;
  const double d1 = ab.dot(ap), d2 = ac.dot(ap);
  if (d1 <= 0 && d2 <= 0) return a;
  const double d3 = ab.dot(bp), d4 = ac.dot(bp);
  if (d3 >= 0 && d4 <= d3) return b;
  const double vc = d1 * d4 - d3 * d2;
  if (vc <= 0 && d1 >= 0 && d3 <= 0) return a + ab * (d1 / (d1 - d3));
  const double d5 = ab.dot(cp), d6 = ac.dot(cp);
  if (d6 >= 0 && d5 <= d6) return c;
  const double vb = d5 * d2 - d1 * d6;
  if (vb <= 0 && d2 >= 0 && d6 <= 0) return a + ac * (d2 / (d2 - d6));
  const double va = d3 * d6 - d5 * d4;
  if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0) {
    return b + (c - b) * ((d4 - d3) / ((d4 - d3) + (d5 - d6)));
  }
  const double sum = va + vb + vc;
  return a + ab * (vb / sum) + ac * (vc / sum);
}

}  // namespace

HalfSpace half_space(const Eigen::Vector3d& normal, double offset) {
  const double length = normal.norm();
  assert(length > 0);
  return {normal / length, offset / length};
}

ConvexPolyhedron::ConvexPolyhedron(std::span<const HalfSpace> half_spaces, double extent) {
  for (int corner = 0; corner < 8; ++corner) {
    vertices_.emplace_back((corner & 1) != 0 ? extent : -extent,
                           (corner & 2) != 0 ? extent : -extent,
                           (corner & 4) != 0 ? extent : -extent);
  }
  for (int axis = 0; axis < 3; ++axis) {
    for (const double sign : {-1.0, 1.0}) {
      const HalfSpace side{sign * Eigen::Vector3d::Unit(axis), extent};
      Polygon corners;
      for (int corner = 0; corner < 8; ++corner) {
        if (((corner >> axis) & 1) == (sign > 0 ? 1 : 0)) corners.push_back(corner);
      }
      faces_.push_back({side, ordered_about(vertices_, corners, side.normal)});
    }
  }
  for (const HalfSpace& one : half_spaces) clip(one, kOnPlane * extent);
  const auto is_of_box = [&](const Face& face) {
    return face.half_space.offset == extent && face.half_space.normal.cwiseAbs().sum() == 1;
  };
  is_cut_by_box_ = std::ranges::any_of(faces_, is_of_box);
  // Keep the vertices in use, and solve each from its planes.
  std::map<int, std::vector<const HalfSpace*>> planes;
  for (const Face& face : faces_) {
    for (const int v : face.vertices) planes[v].push_back(&face.half_space);
  }
  std::vector<Eigen::Vector3d> used;
  std::map<int, int> index;
  for (const auto& [v, of_vertex] : planes) {
    index[v] = static_cast<int>(used.size());
    used.push_back(of_vertex.size() < 3 ? vertices_[v] : meeting_point(of_vertex, vertices_[v]));
  }
  for (Face& face : faces_) {
    for (int& v : face.vertices) v = index.at(v);
  }
  vertices_ = std::move(used);
}

void ConvexPolyhedron::clip(const HalfSpace& half_space, double tolerance) {
  std::vector<double> depth(vertices_.size());
  for (std::size_t v = 0; v < vertices_.size(); ++v) {
    const double exact = half_space.depth_of(vertices_[v]);
    depth[v] = std::abs(exact) <= tolerance ? 0 : exact;
  }
  const auto is_outside = [&](int v) { return depth[v] < 0; };
  const bool is_cut = std::ranges::any_of(
      faces_, [&](const Face& face) { return std::ranges::any_of(face.vertices, is_outside); });
  if (!is_cut) return;
  std::vector<Face> kept;
  std::map<std::pair<int, int>, int> crossings;  // edge -> vertex
  Polygon on_plane;                              // vertices of the new face
  const auto note = [&](int v) {
    if (std::ranges::find(on_plane, v) == on_plane.end()) on_plane.push_back(v);
  };
  const auto crossing = [&](int inside, int outside) {
    const auto [at, is_new] =
        crossings.try_emplace(std::minmax(inside, outside), static_cast<int>(vertices_.size()));
    if (is_new) {
      const double share = depth[inside] / (depth[inside] - depth[outside]);
      vertices_.push_back(vertices_[inside] + share * (vertices_[outside] - vertices_[inside]));
      depth.push_back(0);
    }
    return at->second;
  };
  bool has_same_plane = false;
  for (Face& face : faces_) {
    Polygon polygon;
    int inside = 0;
    for (std::size_t i = 0; i < face.vertices.size(); ++i) {
      const int v = face.vertices[i], next = face.vertices[(i + 1) % face.vertices.size()];
      if (depth[v] >= 0) polygon.push_back(v);
      if (depth[v] > 0) ++inside;

      if (depth[v] > 0 && depth[next] < 0) polygon.push_back(crossing(v, next));
      if (depth[v] < 0 && depth[next] > 0) polygon.push_back(crossing(next, v));
    }
    // A face within the plane stays; it is the new face itself where it looks the same way.
    const bool is_in_plane = inside == 0 && polygon.size() >= 3;
    if (is_in_plane && face.half_space.normal.dot(half_space.normal) > 0) has_same_plane = true;
    for (const int v : polygon) {
      if (depth[v] == 0) note(v);
    }
    if (polygon.size() >= 3) kept.push_back({face.half_space, std::move(polygon)});
  }
  faces_ = std::move(kept);
  if (!has_same_plane && on_plane.size() >= 3) {
    faces_.push_back({half_space, ordered_about(vertices_, on_plane, half_space.normal)});
  }
  if (faces_.size() < 2) faces_.clear();  // a point or an edge is left
}

double ConvexPolyhedron::volume() const {
  if (is_empty()) return 0;
  const Eigen::Vector3d& origin = vertices_.front();
  double six_volumes = 0;
  for (const Face& face : faces_) {
    const Eigen::Vector3d a = vertices_[face.vertices[0]] - origin;
    for (std::size_t i = 1; i + 1 < face.vertices.size(); ++i) {
      const Eigen::Vector3d b = vertices_[face.vertices[i]] - origin;
      const Eigen::Vector3d c = vertices_[face.vertices[i + 1]] - origin;
      six_volumes += a.dot(b.cross(c));
    }
  }
  return std::max(0.0, six_volumes / 6);
}

double ConvexPolyhedron::signed_distance(const Eigen::Vector3d& point) const {
  if (is_empty()) return -std::numeric_limits<double>::infinity();
  if (faces_.empty()) return -(point - vertices_.front()).norm();
  if (is_flat()) return signed_distance_in_plane(point);
  double depth = std::numeric_limits<double>::infinity();
  for (const Face& face : faces_) depth = std::min(depth, face.half_space.depth_of(point));
  if (depth >= 0) return depth;
  return -(nearest_point(point) - point).norm();
}

double ConvexPolyhedron::signed_distance_in_plane(const Eigen::Vector3d& point) const {
  double extent = 0;
  for (const Eigen::Vector3d& vertex : vertices_) extent = std::max(extent, vertex.norm());
  constexpr double kOnPlane = 1e-12;
  const double outside = (nearest_point(point) - point).norm();
  if (outside > kOnPlane * extent) return -outside;
  const std::vector<int>& border = faces_.front().vertices;
  double depth = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < border.size(); ++i) {
    const Eigen::Vector3d& from = vertices_[border[i]];
    const Eigen::Vector3d along = (vertices_[border[(i + 1) % border.size()]] - from).normalized();
    const Eigen::Vector3d to = point - from;
    depth = std::min(depth, (to - along.dot(to) * along).norm());
  }
  return depth;
}

Eigen::Vector3d ConvexPolyhedron::nearest_point(const Eigen::Vector3d& point) const {
  assert(!is_empty());
  const auto holds = [&](const Face& face) { return face.half_space.depth_of(point) >= 0; };
  // On the plane of a flat one both faces hold everywhere.
  if (!faces_.empty() && !is_flat() && std::ranges::all_of(faces_, holds)) return point;
  Eigen::Vector3d nearest = vertices_.front();
  for (const Face& face : faces_) {
    for (std::size_t i = 1; i + 1 < face.vertices.size(); ++i) {
      const Eigen::Vector3d candidate =
          nearest_in_triangle(point, vertices_[face.vertices[0]], vertices_[face.vertices[i]],
                              vertices_[face.vertices[i + 1]]);
      if ((candidate - point).squaredNorm() < (nearest - point).squaredNorm()) nearest = candidate;
    }
  }
  return nearest;
}

}  // namespace raystage::rig
