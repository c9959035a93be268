// SPDX-License-Identifier: Apache-2.0
// Computes which rays through a position several arrays recorded (thesis 6.2), as spherical
// polygons. In the frame of an array, the ray from P in the direction d crosses its plane at
// P + t d with t = a / b, a = P_z, b = -d_z, and b > 0 where the cameras look. It was recorded if
// its slope d_xy / b is one that the cameras see, and P_xy + t d_xy is in the hull. Both are linear
// in d. From there it passes through the plane of another array j if t_j > t_i; multiplied by both
// b, that is linear, too, with the sign of b_j. What is left of the view is divided by the planes
// of each set of directions that is taken away. Of arrays that are not ideal, the rays of an ideal
// one inside of them are taken away first, and of the rest those of their cells. Cost: microseconds
// for an ideal array, and some 100 for six that hide each other.
#include "rig/planning/combined_arrays.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <iterator>
#include <limits>
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

/// Returns how far positions of two arrays in the world may be rounded, metres.
double rounding_of(const MemberArray& a, const MemberArray& b) {
  constexpr double kRounding = 4 * std::numeric_limits<double>::epsilon();
  return kRounding * (a.rays.pose.position.norm() + b.rays.pose.position.norm());
}

/// Returns whether a part of an array is in front of the plane of another one, where it may hide
/// something.
bool is_in_front(const MemberArray& array, const MemberArray& of) {
  return std::ranges::any_of(array.outline, [&](const Vector2d& corner) {
    const Vector3d at = of.rays.pose.camera_from_world(
        array.rays.pose.world_from_camera(Vector3d(corner.x(), corner.y(), 0)));
    constexpr double kTouching = 1e-12;  // of the distance
    return at.z() < -(kTouching * at.norm() + rounding_of(array, of));
  });
}

}  // namespace

CombinedArrays::CombinedArrays(std::vector<MemberArray> arrays, bool hide_each_other)
    : arrays_(std::move(arrays)), hidden_by_(arrays_.size()) {
  for (std::size_t i = 0; i < arrays_.size() && hide_each_other; ++i) {
    for (std::size_t j = 0; j < arrays_.size(); ++j) {
      if (j != i && is_in_front(arrays_[j], arrays_[i])) hidden_by_[i].push_back(j);
    }
  }
}

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
  const auto angle_of = [](const std::vector<DirectionPolygon>& parts) {
    double angle = 0;
    for (const DirectionPolygon& part : parts) angle += part.solid_angle();
    return angle;
  };
  constexpr double kAll = 4 * std::numbers::pi, kRounding = 1e-9;
  SeenPoint seen;
  std::vector<DirectionPolygon> left = all_directions();
  for (std::size_t i = 0; i < arrays_.size(); ++i) {
    if (!(arrays_[i].rays.pose.camera_from_world(point).z() < 0)) continue;
    const double not_by_it =
        angle_of(unrecorded_by(i, point, all_directions(), Hiding::kUntilThePosition));
    if (not_by_it < kAll * (1 - kRounding)) ++seen.arrays;
    left = unrecorded_by(i, point, std::move(left), Hiding::kUntilThePosition);
  }
  seen.share = std::clamp(1 - angle_of(left) / kAll, 0.0, 1.0);
  return seen;
}

std::vector<DirectionPolygon> CombinedArrays::unrecorded(
    const Vector3d& position, std::vector<DirectionPolygon> directions) const {
  for (std::size_t i = 0; i < arrays_.size() && !directions.empty(); ++i) {
    directions = unrecorded_by(i, position, std::move(directions), Hiding::kBeyondTheArray);
  }
  return directions;
}

std::vector<DirectionPolygon> CombinedArrays::unrecorded_by(
    std::size_t array, const Vector3d& position, std::vector<DirectionPolygon> directions,
    Hiding hiding) const {
  auto [recorded, left] = divide(arrays_[array], position, directions);
  // What other arrays hide stays unrecorded.
  for (const Cone& cone : hidden(array, position, hiding)) {
    std::ranges::move(within(recorded, cone), std::back_inserter(left));
    recorded = without(recorded, cone);
  }
  return left;
}

DividedDirections CombinedArrays::divide(const MemberArray& array, const Vector3d& position,
                                         std::span<const DirectionPolygon> directions) {
  const WallEyedArray& rays = array.rays;
  Cone cone{{0, 0, -1}};
  for (const int axis : {0, 1}) {
    Vector3d above = Vector3d::Unit(axis), below = -Vector3d::Unit(axis);
    above.z() = rays.slopes.least[axis];
    below.z() = -rays.slopes.largest[axis];
    cone.insert(cone.end(), {above, below});
  }
  add_crossing(rays.hull, rays.pose.camera_from_world(position), cone);
  for (Vector3d& normal : cone) normal = rays.pose.world_from_camera_rotation * normal;
  DividedDirections divided{within(directions, cone), without(directions, cone)};
  if (array.cells.is_empty()) return divided;
  DividedDirections others = array.cells.divide(position, std::move(divided.unrecorded));
  std::ranges::move(others.recorded, std::back_inserter(divided.recorded));
  divided.unrecorded = std::move(others.unrecorded);
  return divided;
}

std::vector<CombinedArrays::Cone> CombinedArrays::hidden(std::size_t array,
                                                         const Vector3d& position,
                                                         Hiding hiding) const {
  std::vector<Cone> cones;
  const Pose& pose = arrays_[array].rays.pose;
  const double depth = pose.camera_from_world(position).z();
  const Vector3d back = pose.world_from_camera_rotation.col(2);
  for (const std::size_t j : hidden_by_[array]) {
    const MemberArray& other = arrays_[j];
    const Vector3d in_other = other.rays.pose.camera_from_world(position);
    const Eigen::Matrix3d& rotation = other.rays.pose.world_from_camera_rotation;
    // a_j b_i - a_i b_j as a normal.
    const Vector3d behind = -in_other.z() * back + depth * rotation.col(2);
    Cone cone{-Vector3d::UnitZ()};
    add_crossing(other.outline, in_other, cone);
    for (Vector3d& normal : cone) normal = rotation * normal;
    cone.push_back(behind);
    // The sign of a_j / b_j says on which side of the position the ray crosses the array: with
    // a_j < 0, before it for b_j > 0.
    const bool all = hiding == Hiding::kBeyondTheArray;
    if (all || in_other.z() < 0) cones.push_back(cone);
    for (Vector3d& normal : cone) normal = -normal;
    if (all || in_other.z() > 0) cones.push_back(std::move(cone));
  }
  return cones;
}

}  // namespace raystage::rig
