// SPDX-License-Identifier: Apache-2.0
#include "rig/planning/wall_eyed_array.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

namespace raystage::rig {
namespace {

/// Returns twice the area of a triangle, positive if it is counter-clockwise.
double cross(const Eigen::Vector2d& a, const Eigen::Vector2d& b, const Eigen::Vector2d& c) {
  return (b.x() - a.x()) * (c.y() - a.y()) - (b.y() - a.y()) * (c.x() - a.x());
}

/// Adds points to one side of a hull (Andrew, "Another efficient algorithm for convex hulls in two
/// dimensions", 1979).
void add_side(const std::vector<Eigen::Vector2d>& points, std::vector<Eigen::Vector2d>& hull) {
  const std::size_t first = hull.size();
  for (const Eigen::Vector2d& point : points) {
    while (hull.size() >= first + 2 && cross(hull[hull.size() - 2], hull.back(), point) <= 0) {
      hull.pop_back();
    }
    hull.push_back(point);
  }
  hull.pop_back();  // it begins the other side
}

/// Returns the distance of a point from a segment.
double distance_from_segment(const Eigen::Vector2d& point, const Eigen::Vector2d& a,
                             const Eigen::Vector2d& b) {
  const Eigen::Vector2d side = b - a;
  const double squared = side.squaredNorm();
  const double share = squared > 0 ? std::clamp(side.dot(point - a) / squared, 0.0, 1.0) : 0;
  return (point - a - share * side).norm();
}

void remove_straight_corners(std::vector<Eigen::Vector2d>& hull, double tolerance) {
  for (std::size_t i = 0; i < hull.size() && hull.size() > 2;) {
    const Eigen::Vector2d& before = hull[(i + hull.size() - 1) % hull.size()];
    const Eigen::Vector2d& after = hull[(i + 1) % hull.size()];
    if (distance_from_segment(hull[i], before, after) <= tolerance) {
      hull.erase(hull.begin() + static_cast<std::ptrdiff_t>(i));
      i = 0;
    } else {
      ++i;
    }
  }
  if (hull.size() == 2 && (hull[1] - hull[0]).norm() <= tolerance) hull.pop_back();
}

double largest_difference(const SlopeRange& a, const SlopeRange& b) {
  return std::max((a.least - b.least).cwiseAbs().maxCoeff(),
                  (a.largest - b.largest).cwiseAbs().maxCoeff());
}

}  // namespace

bool SlopeRange::contains(const Eigen::Vector2d& slope) const {
  constexpr double kRounding = 1e-12;
  for (int axis = 0; axis < 2; ++axis) {
    const double slack =
        kRounding * std::max({1.0, std::abs(least(axis)), std::abs(largest(axis))});
    if (slope(axis) < least(axis) - slack || slope(axis) > largest(axis) + slack) return false;
  }
  return true;
}

std::vector<Eigen::Vector2d> SlopeRange::corners() const {
  return {least, {largest.x(), least.y()}, largest, {least.x(), largest.y()}};
}

SlopeRange symmetric_slopes(double horizontal_fov, double vertical_fov) {
  const Eigen::Vector2d half(std::tan(horizontal_fov / 2), std::tan(vertical_fov / 2));
  return {-half, half};
}

SlopeRange camera_slopes(const schemas::Intrinsics& intrinsics, int width, int height) {
  return {{-intrinsics.cx / intrinsics.fx, (intrinsics.cy - height) / intrinsics.fy},
          {(width - intrinsics.cx) / intrinsics.fx, intrinsics.cy / intrinsics.fy}};
}

Eigen::Vector2d WallEyedArray::size() const {
  Eigen::Vector2d least = hull.front(), largest = hull.front();
  for (const Eigen::Vector2d& corner : hull) {
    least = least.cwiseMin(corner);
    largest = largest.cwiseMax(corner);
  }
  return largest - least;
}

std::vector<Eigen::Vector2d> convex_hull(std::vector<Eigen::Vector2d> points, double tolerance) {
  std::ranges::sort(points, [](const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
    return a.x() != b.x() ? a.x() < b.x() : a.y() < b.y();
  });
  points.erase(std::unique(points.begin(), points.end()), points.end());
  std::vector<Eigen::Vector2d> hull = points;
  if (points.size() > 2) {
    hull.clear();
    add_side(points, hull);
    std::ranges::reverse(points);
    add_side(points, hull);
  }
  remove_straight_corners(hull, tolerance);
  return hull;
}

std::optional<WallEyedArray> find_wall_eyed_array(const Rig& rig,
                                                  const WallEyedTolerance& tolerance,
                                                  std::string* reason) {
  const auto refuse = [&](std::string why) {
    if (reason != nullptr) *reason = std::move(why);
    return std::nullopt;
  };
  if (rig.cameras.empty()) return refuse("it has no cameras");
  const Rig::Camera& first = rig.cameras.front();
  const auto slopes_of = [](const Rig::Camera& camera) {
    return camera_slopes(camera.model.intrinsics(), camera.model.width(), camera.model.height());
  };
  WallEyedArray array;
  array.slopes = slopes_of(first);
  array.pose.world_from_camera_rotation = first.pose.world_from_camera_rotation;
  array.pose.position = first.pose.position;
  std::vector<Eigen::Vector3d> centres;
  Eigen::Vector3d least = Eigen::Vector3d::Zero(), largest = least;
  for (const Rig::Camera& camera : rig.cameras) {
    if (camera.model.has_distortion()) {
      return refuse(fmt::format("camera {} has lens distortion", camera.id));
    }
    if (largest_difference(slopes_of(camera), array.slopes) > tolerance.slope) {
      return refuse(
          fmt::format("cameras {} and {} have different fields of view", first.id, camera.id));
    }
    const Eigen::Matrix3d between =
        first.pose.world_from_camera_rotation.transpose() * camera.pose.world_from_camera_rotation;
    if ((between - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff() > tolerance.rotation) {
      return refuse(fmt::format("cameras {} and {} are not parallel", first.id, camera.id));
    }
    centres.push_back(first.pose.camera_from_world(camera.pose.position));
    least = least.cwiseMin(centres.back());
    largest = largest.cwiseMax(centres.back());
  }
  const double extent = (largest - least).norm();
  // Coordinates far from the world's origin are rounded.
  const double rounding =
      4 * std::numeric_limits<double>::epsilon() * first.pose.position.cwiseAbs().maxCoeff();
  const double on_plane = tolerance.position * extent + 2 * rounding;
  if (largest.z() - least.z() > on_plane) {
    return refuse(fmt::format("the cameras' centres are up to {:.3g} m in front of each other",
                              largest.z() - least.z()));
  }
  const Eigen::Vector3d middle = (least + largest) / 2;
  array.pose.position = first.pose.world_from_camera(middle);
  std::vector<Eigen::Vector2d> points;
  for (const Eigen::Vector3d& centre : centres) points.emplace_back((centre - middle).head<2>());
  array.hull = convex_hull(std::move(points), on_plane);
  return array;
}

}  // namespace raystage::rig
