// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

namespace raystage::rig {

/// The points x with normal.x <= offset. `normal`: unit.
struct HalfSpace {
  Eigen::Vector3d normal = Eigen::Vector3d::UnitX();
  double offset = 0;

  /// Returns how far a point is inside, metres; negative outside.
  double depth_of(const Eigen::Vector3d& point) const { return offset - normal.dot(point); }
};

/// Returns the half-space of the points with normal.x <= offset, for a normal of any length but 0.
HalfSpace half_space(const Eigen::Vector3d& normal, double offset);

/// A bounded intersection of half-spaces, which may be empty, or flat where it has no volume. An
/// intersection that is only an edge or a point counts as empty.
class ConvexPolyhedron {
 public:
  /// A face: vertices counter-clockwise as seen from outside.
  struct Face {
    HalfSpace half_space;
    std::vector<int> vertices;  ///< indices into vertices()
  };

  ConvexPolyhedron() = default;  ///< empty
  /// Contains one point only.
  explicit ConvexPolyhedron(const Eigen::Vector3d& point) : vertices_{point} {}
  /// Intersects half-spaces with the box of the points whose coordinates are at most `extent`. A
  /// point counts as on a plane within 1e-13 of the extent.
  ConvexPolyhedron(std::span<const HalfSpace> half_spaces, double extent);

  bool is_empty() const { return vertices_.empty(); }
  /// Returns whether a face of the box bounds the polyhedron: without it, it might be unbounded.
  /// Not determined for flat ones.
  bool is_cut_by_box() const { return is_cut_by_box_; }
  const std::vector<Eigen::Vector3d>& vertices() const { return vertices_; }
  const std::vector<Face>& faces() const { return faces_; }
  double volume() const;  ///< cubic units

  /// Returns the distance of a point from the boundary: positive inside, negative outside; minus
  /// infinity for an empty polyhedron. Of a point on the plane of a flat one, the boundary is that
  /// of the polygon.
  double signed_distance(const Eigen::Vector3d& point) const;
  /// Returns the point of the polyhedron that is nearest to `point`. Must not be empty.
  Eigen::Vector3d nearest_point(const Eigen::Vector3d& point) const;

 private:
  void clip(const HalfSpace& half_space, double tolerance);
  /// A polyhedron with a volume has four faces at least.
  bool is_flat() const { return faces_.size() == 2; }
  double signed_distance_in_plane(const Eigen::Vector3d& point) const;

  std::vector<Eigen::Vector3d> vertices_;
  std::vector<Face> faces_;
  bool is_cut_by_box_ = false;
};

}  // namespace raystage::rig
