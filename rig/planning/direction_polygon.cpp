// SPDX-License-Identifier: Apache-2.0
#include "rig/planning/direction_polygon.h"

#include <Eigen/Geometry>
#include <cmath>
#include <utility>

namespace raystage::rig {

using Eigen::Vector3d;

DirectionPolygon::DirectionPolygon(std::span<const Vector3d> corners) {
  for (const Vector3d& corner : corners) corners_.push_back(corner.normalized());
}

DirectionPolygon DirectionPolygon::clipped(const Vector3d& normal) const {
  DirectionPolygon kept;
  if (is_empty()) return kept;
  const Vector3d* from = &corners_.back();
  double at_from = normal.dot(*from);
  for (const Vector3d& to : corners_) {
    const double at_to = normal.dot(to);
    if ((at_from >= 0) != (at_to >= 0)) {
      const Vector3d between = *from + at_from / (at_from - at_to) * (to - *from);
      kept.corners_.push_back(between.normalized());
    }
    if (at_to >= 0) kept.corners_.push_back(to);
    from = &to;
    at_from = at_to;
  }
  return kept;
}

double DirectionPolygon::solid_angle() const {
  // Triangles by Van Oosterom and Strackee, "The Solid Angle of a Plane Triangle" (1983).
  double sum = 0;
  for (std::size_t i = 2; i < corners_.size(); ++i) {
    const Vector3d &a = corners_[0], &b = corners_[i - 1], &c = corners_[i];
    sum += 2 * std::atan2(a.dot(b.cross(c)), 1 + a.dot(b) + b.dot(c) + c.dot(a));
  }
  return std::abs(sum);
}

double DirectionPolygon::picture_area(const Eigen::Matrix3d& picture_from_world) const {
  boost::container::small_vector<Eigen::Vector2d, 10> points;
  for (const Vector3d& corner : corners_) {
    const Vector3d in_picture = picture_from_world * corner;
    points.emplace_back(in_picture.head<2>() / -in_picture.z());
  }
  double twice = 0;
  for (std::size_t i = 2; i < points.size(); ++i) {
    const Eigen::Vector2d a = points[i - 1] - points[0], b = points[i] - points[0];
    twice += a.x() * b.y() - a.y() * b.x();
  }
  return std::abs(twice) / 2;
}

std::vector<DirectionPolygon> all_directions() {
  std::vector<DirectionPolygon> sides;
  for (int axis = 0; axis < 3; ++axis) {
    for (const double sign : {1.0, -1.0}) {
      std::array<Vector3d, 4> corners;
      for (std::size_t i = 0; i < 4; ++i) {
        corners[i][axis] = sign;
        corners[i][(axis + 1) % 3] = i == 1 || i == 2 ? 1 : -1;
        corners[i][(axis + 2) % 3] = i >= 2 ? 1 : -1;
      }
      sides.emplace_back(corners);
    }
  }
  return sides;
}

std::vector<DirectionPolygon> within(std::span<const DirectionPolygon> polygons,
                                     std::span<const Vector3d> normals) {
  std::vector<DirectionPolygon> inside;
  for (DirectionPolygon polygon : polygons) {
    for (const Vector3d& normal : normals) polygon = polygon.clipped(normal);
    if (!polygon.is_empty()) inside.push_back(std::move(polygon));
  }
  return inside;
}

std::vector<DirectionPolygon> without(std::span<const DirectionPolygon> polygons,
                                      std::span<const Vector3d> normals) {
  std::vector<DirectionPolygon> outside;
  for (const DirectionPolygon& polygon : polygons) {
    DirectionPolygon common = polygon;
    for (const Vector3d& normal : normals) common = common.clipped(normal);
    if (common.is_empty()) {
      outside.push_back(polygon);
      continue;
    }
    DirectionPolygon inside = polygon;
    for (const Vector3d& normal : normals) {
      if (normal.isZero(0)) continue;  // all directions are on both sides
      DirectionPolygon beyond = inside.clipped(-normal);
      if (!beyond.is_empty()) outside.push_back(std::move(beyond));
      inside = inside.clipped(normal);
    }
  }
  return outside;
}

}  // namespace raystage::rig
