// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <boost/container/small_vector.hpp>
#include <span>
#include <vector>

namespace raystage::rig {

/// A convex set of directions from one place, which are all on one side of a plane: a spherical
/// polygon.
class DirectionPolygon {
 public:
  DirectionPolygon() = default;  ///< empty
  /// `corners`: of any length but 0, in order around the polygon.
  explicit DirectionPolygon(std::span<const Eigen::Vector3d> corners);

  bool is_empty() const { return corners_.size() < 3; }
  /// Returns the part of the directions d with normal.d >= 0.
  DirectionPolygon clipped(const Eigen::Vector3d& normal) const;
  double solid_angle() const;  ///< steradians
  /// Returns the area in a picture at distance 1 from its centre of projection. The polygon must be
  /// in front of it. The picture's frame looks along -z.
  double picture_area(const Eigen::Matrix3d& picture_from_world) const;

 private:
  boost::container::small_vector<Eigen::Vector3d, 10> corners_;  // unit
};

/// Returns all directions as the six sides of a cube.
std::vector<DirectionPolygon> all_directions();

/// Returns the parts of polygons in the intersection of half-spaces n.d >= 0.
std::vector<DirectionPolygon> within(std::span<const DirectionPolygon> polygons,
                                     std::span<const Eigen::Vector3d> normals);

/// Returns convex parts of the directions of `polygons` that are not in the intersection of
/// half-spaces n.d >= 0. Neither `polygons` nor the result overlap.
std::vector<DirectionPolygon> without(std::span<const DirectionPolygon> polygons,
                                      std::span<const Eigen::Vector3d> normals);

}  // namespace raystage::rig
