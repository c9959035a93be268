// SPDX-License-Identifier: Apache-2.0
// Computes which rays through a position several arrays recorded (thesis 6.2), as spherical
// polygons. In the frame of an array, the ray from P in the direction d crosses its plane at
// P + t d with t = a / b, a = P_z, b = -d_z, and b > 0 where the cameras look. It was recorded if
// its slope d_xy / b is one that the cameras see, and P_xy + t d_xy is in the hull. Both are linear
// in d. From there it passes through the plane of another array j if t_j > t_i; multiplied by both
// b, that is linear, too, with the sign of b_j. What is left of the view is divided by the planes
// of each set of directions that is taken away. Cost: microseconds for an array, and some 100 for
// six that hide each other.
#include "rig/planning/combined_arrays.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <numbers>
#include <utility>

namespace raystage::rig {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

/// Appends normals for directions whose line through P crosses an outline, with b > 0 (in the
/// array's frame).
void add_crossing(const std::vector<Vector2d>& outline, const Vector3d& position,
                  std::vector<Vector3d>& normals) {
  for (std::size_t i = 0; i < outline.size(); ++i) {
    const Vector2d side = outline[(i + 1) % outline.size()] - outline[i];
    const Vector2d outwards = Vector2d(side.y(), -side.x()).normalized();
    const double inside = outwards.dot(outline[i] - position.head<2>());
    normals.emplace_back(-position.z() * outwards.x(), -position.z() * outwards.y(), -inside);
  }
}

/// Returns whether an array is nowhere in front of another's plane, where it hides nothing.
bool is_behind(const MemberArray& array, const Pose& plane) {
  constexpr double kTouching = 1e-12;  // of the distance
  return std::ranges::all_of(array.outline, [&](const Vector2d& corner) {
    const Vector3d at = plane.camera_from_world(
        array.rays.pose.world_from_camera(Vector3d(corner.x(), corner.y(), 0)));
    return at.z() >= -kTouching * at.norm();
  });
}

}  // namespace

CombinedArrays::CombinedArrays(std::vector<MemberArray> arrays, bool hide_each_other)
    : arrays_(std::move(arrays)), hide_each_other_(hide_each_other) {}

double CombinedArrays::recorded_share(const Vector3d& position, const ViewFrustum& view) const {
  std::array<Vector3d, 4> corners;
  const std::vector<Vector2d> slopes = view.slopes.corners();
  for (std::size_t i = 0; i < 4; ++i) {
    corners[i] = view.world_from_camera_rotation * Vector3d(slopes[i].x(), slopes[i].y(), -1);
  }
  const Eigen::Matrix3d picture_from_world = view.world_from_camera_rotation.transpose();
  double area = 0;
  for (const DirectionPolygon& part : unrecorded(position, {DirectionPolygon(corners)})) {
    area += part.picture_area(picture_from_world);
  }
  const Vector2d size = view.slopes.largest - view.slopes.least;
  return std::clamp(1 - area / (size.x() * size.y()), 0.0, 1.0);
}

double CombinedArrays::recorded_share_of_all(const Vector3d& position) const {
  double angle = 0;
  for (const DirectionPolygon& part : unrecorded(position, all_directions())) {
    angle += part.solid_angle();
  }
  return std::clamp(1 - angle / (4 * std::numbers::pi), 0.0, 1.0);
}

CombinedArrays::SeenPoint CombinedArrays::seen_point(const Vector3d& point) const {
  // An array sees what is in front of it, unless another one is between them.
  std::vector<MemberArray> facing;
  for (const MemberArray& array : arrays_) {
    if (array.rays.pose.camera_from_world(point).z() < 0) facing.push_back(array);
  }
  SeenPoint seen;
  seen.share = CombinedArrays(facing, hide_each_other_).recorded_share_of_all(point);
  for (const MemberArray& array : facing) {
    const bool sees = CombinedArrays({array}, false).recorded_share_of_all(point) > 0;
    seen.arrays += sees ? 1 : 0;
  }
  return seen;
}

std::vector<DirectionPolygon> CombinedArrays::unrecorded(
    const Vector3d& position, std::vector<DirectionPolygon> directions) const {
  for (std::size_t i = 0; i < arrays_.size() && !directions.empty(); ++i) {
    const WallEyedArray& array = arrays_[i].rays;
    const Vector3d in_array = array.pose.camera_from_world(position);
    Cone recorded{{0, 0, -1}};
    for (const int axis : {0, 1}) {
      Vector3d above = Vector3d::Unit(axis), below = -Vector3d::Unit(axis);
      above.z() = array.slopes.least[axis];
      below.z() = -array.slopes.largest[axis];
      recorded.insert(recorded.end(), {above, below});
    }
    add_crossing(array.hull, in_array, recorded);
    for (Vector3d& normal : recorded) {
      normal = array.pose.world_from_camera_rotation * normal;
    }
    std::vector<DirectionPolygon> kept = without(directions, recorded);
    // What other arrays hide stays unrecorded.
    const std::vector<Cone> hidden_cones = hidden(i, in_array);
    if (!hidden_cones.empty()) {
      std::vector<DirectionPolygon> seen;
      for (DirectionPolygon part : directions) {
        for (const Vector3d& normal : recorded) part = part.clipped(normal);
        if (!part.is_empty()) seen.push_back(std::move(part));
      }
      for (const Cone& cone : hidden_cones) {
        for (DirectionPolygon part : seen) {
          for (const Vector3d& normal : cone) part = part.clipped(normal);
          if (!part.is_empty()) kept.push_back(std::move(part));
        }
        seen = without(seen, cone);
      }
    }
    directions = std::move(kept);
  }
  return directions;
}

std::vector<CombinedArrays::Cone> CombinedArrays::hidden(std::size_t array,
                                                         const Vector3d& in_array) const {
  std::vector<Cone> cones;
  if (!hide_each_other_) return cones;
  const Pose& pose = arrays_[array].rays.pose;
  const Vector3d back = pose.world_from_camera_rotation.col(2);
  for (std::size_t j = 0; j < arrays_.size(); ++j) {
    const MemberArray& other = arrays_[j];
    if (j == array || is_behind(other, pose)) continue;
    const Vector3d in_other = other.rays.pose.camera_from_world(pose.world_from_camera(in_array));
    const Eigen::Matrix3d& rotation = other.rays.pose.world_from_camera_rotation;
    // a_j b_i - a_i b_j as a normal.
    const Vector3d behind = -in_other.z() * back + in_array.z() * rotation.col(2);
    constexpr double kOnePlane = 1e-9;
    if (behind.norm() <= kOnePlane * (std::abs(in_other.z()) + std::abs(in_array.z()))) continue;
    Cone cone{-Vector3d::UnitZ()};
    add_crossing(other.outline, in_other, cone);
    for (Vector3d& normal : cone) normal = rotation * normal;
    cone.push_back(behind);
    cones.push_back(cone);
    for (Vector3d& normal : cone) normal = -normal;
    cones.push_back(std::move(cone));
  }
  return cones;
}

}  // namespace raystage::rig
