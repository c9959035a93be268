// SPDX-License-Identifier: Apache-2.0
#include "rig/planning/wall_eyed_array.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <utility>

#include "rig/array_plane.h"

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

/// Narrows `slopes` to those that a camera sees, with lens distortion. Returns false where it does
/// not look to where the array looks.
bool keep_common_slopes(const Rig::Camera& camera, const Eigen::Matrix3d& array_from_world,
                        SlopeRange& slopes) {
  constexpr int kParts = 32;  // of each border
  const Eigen::Matrix3d array_from_camera =
      array_from_world * camera.pose.world_from_camera_rotation;
  const double width = camera.model.width(), height = camera.model.height();
  const auto slope_at = [&](double x, double y) -> std::optional<Eigen::Vector2d> {
    const auto ray = camera.model.unproject({x, y});
    if (!ray) return std::nullopt;
    const Eigen::Vector3d in_array = array_from_camera * *ray;
    if (!(in_array.z() < 0)) return std::nullopt;
    return in_array.head<2>() / -in_array.z();
  };
  for (int i = 0; i <= kParts; ++i) {
    const double x = width * i / kParts, y = height * i / kParts;
    const auto left = slope_at(0, y), right = slope_at(width, y), top = slope_at(x, 0),
               bottom = slope_at(x, height);
    if (!left || !right || !top || !bottom) return false;
    slopes.least.x() = std::max(slopes.least.x(), left->x());
    slopes.largest.x() = std::min(slopes.largest.x(), right->x());
    slopes.least.y() = std::max(slopes.least.y(), bottom->y());
    slopes.largest.y() = std::min(slopes.largest.y(), top->y());
  }
  return true;
}

/// Moves side i of a convex polygon inwards by `distances[i]`, metres. Returns an empty one where
/// nothing is left.
std::vector<Eigen::Vector2d> inset(const std::vector<Eigen::Vector2d>& hull,
                                   const std::vector<double>& distances) {
  std::vector<Eigen::Vector2d> inner = hull;
  for (std::size_t i = 0; i < hull.size(); ++i) {
    const Eigen::Vector2d side = (hull[(i + 1) % hull.size()] - hull[i]).normalized();
    const Eigen::Vector2d inwards(-side.y(), side.x());
    const auto depth = [&](const Eigen::Vector2d& point) {
      return inwards.dot(point - hull[i]) - distances[i];
    };
    std::vector<Eigen::Vector2d> kept;
    for (std::size_t k = 0; k < inner.size(); ++k) {
      const Eigen::Vector2d &from = inner[k], &to = inner[(k + 1) % inner.size()];
      const double at_from = depth(from), at_to = depth(to);
      if (at_from >= 0) kept.push_back(from);
      if ((at_from >= 0) != (at_to >= 0)) {
        kept.push_back(from + at_from / (at_from - at_to) * (to - from));
      }
    }
    inner = std::move(kept);
  }
  return inner.size() < 3 ? std::vector<Eigen::Vector2d>{} : inner;
}

/// Returns the cameras at the border of the cells: those of sides that only one triangle has.
std::vector<int> border_cameras(const Topology& topology) {
  std::map<std::pair<int, int>, int> uses;
  for (const Topology::Cell& cell : topology.cells) {
    for (std::size_t i = 0; i < 3; ++i) {
      const auto [low, high] = std::minmax(cell[i], cell[(i + 1) % 3]);
      ++uses[{low, high}];
    }
  }
  std::vector<int> cameras;
  for (const auto& [side, count] : uses) {
    if (count == 1) cameras.insert(cameras.end(), {side.first, side.second});
  }
  std::ranges::sort(cameras);
  cameras.erase(std::unique(cameras.begin(), cameras.end()), cameras.end());
  return cameras;
}

/// Returns for each side of the hull how far the border of the cells lies inside of it, metres.
std::vector<double> border_depths(const std::vector<Eigen::Vector2d>& hull,
                                  const std::vector<Eigen::Vector2d>& border) {
  std::vector<double> depths(hull.size(), 0);
  for (const Eigen::Vector2d& point : border) {
    std::size_t nearest = 0;
    double least = std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < hull.size(); ++i) {
      const double distance = distance_from_segment(point, hull[i], hull[(i + 1) % hull.size()]);
      if (distance < least) {
        least = distance;
        nearest = i;
      }
    }
    depths[nearest] = std::max(depths[nearest], least);
  }
  return depths;
}

double plane_extent(const std::vector<Eigen::Vector3d>& centres) {
  Eigen::AlignedBox3d box;
  for (const Eigen::Vector3d& centre : centres) box.extend(centre);
  return box.diagonal().norm();
}

/// Returns axes of an array: z against the mean viewing direction and normal to its plane, x as the
/// cameras' on the mean.
Eigen::Matrix3d world_from_array_axes(const Rig& rig, const Eigen::Vector3d& normal) {
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  for (const Rig::Camera& camera : rig.cameras) {
    right += camera.pose.world_from_camera_rotation.col(0);
  }
  right -= right.dot(normal) * normal;
  if (right.norm() < 1e-9) right = normal.unitOrthogonal();
  Eigen::Matrix3d axes;
  axes.col(0) = right.normalized();
  axes.col(1) = normal.cross(axes.col(0));
  axes.col(2) = normal;
  return axes;
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

std::optional<WallEyedArray> inscribed_wall_eyed_array(const Rig& rig, const Topology& topology,
                                                       std::string* reason) {
  const auto refuse = [&](std::string why) {
    if (reason != nullptr) *reason = std::move(why);
    return std::nullopt;
  };
  if (rig.cameras.empty()) return refuse("it has no cameras");
  std::vector<Eigen::Vector3d> centres, directions;
  for (const Rig::Camera& camera : rig.cameras) {
    centres.push_back(camera.pose.position);
    directions.emplace_back(-camera.pose.world_from_camera_rotation.col(2));
  }
  const ArrayPlane plane = fit_array_plane(centres, directions);
  WallEyedArray array;
  array.pose.world_from_camera_rotation = world_from_array_axes(rig, plane.normal);
  array.pose.position = rig.centre();
  const Eigen::Matrix3d array_from_world = array.pose.world_from_camera_rotation.transpose();
  constexpr double kAll = std::numeric_limits<double>::max();
  array.slopes = {{-kAll, -kAll}, {kAll, kAll}};
  for (const Rig::Camera& camera : rig.cameras) {
    if (!keep_common_slopes(camera, array_from_world, array.slopes)) {
      return refuse(fmt::format("camera {} does not look to where the array looks", camera.id));
    }
  }
  if (!(array.slopes.least.array() < array.slopes.largest.array()).all()) {
    return refuse("the cameras see no direction in common");
  }
  std::vector<Eigen::Vector2d> points;
  double off_plane = 0;
  for (const Eigen::Vector3d& centre : centres) {
    const Eigen::Vector3d in_array = array.pose.camera_from_world(centre);
    points.emplace_back(in_array.head<2>());
    off_plane = std::max(off_plane, std::abs(in_array.z()));
  }
  if (plane.dimension < 2) {  // a row or one position: on its line
    const Eigen::Vector2d along = (array_from_world * plane.along).head<2>();
    for (Eigen::Vector2d& point : points) point = point.dot(along) * along;
    if (plane.dimension == 0) points.assign(1, Eigen::Vector2d::Zero());
  }
  array.hull = convex_hull(points, 1e-9 * plane_extent(centres));
  if (array.hull.size() == 1) return array;
  // Between the plane and a centre in front of or behind it a ray moves by at most that much.
  const double steepest =
      std::hypot(std::max(std::abs(array.slopes.least.x()), std::abs(array.slopes.largest.x())),
                 std::max(std::abs(array.slopes.least.y()), std::abs(array.slopes.largest.y())));
  if (array.hull.size() == 2) {
    const Eigen::Vector2d along = array.hull[1] - array.hull[0];
    const double shorter = off_plane * steepest / along.norm();
    if (!(shorter < 0.5)) return refuse("the cameras are too far in front of each other");
    array.hull = {array.hull[0] + shorter * along, array.hull[1] - shorter * along};
    return array;
  }
  std::vector<Eigen::Vector2d> border;
  for (const int camera : border_cameras(topology)) border.push_back(points[camera]);
  std::vector<double> distances = border_depths(array.hull, border);
  for (double& distance : distances) distance += off_plane * steepest;
  array.hull = inset(array.hull, distances);
  if (array.hull.empty()) return refuse("the cameras are too far in front of each other");
  return array;
}

std::optional<RecordedArray> recorded_array(const Rig& rig, std::string* reason) {
  if (auto ideal = find_wall_eyed_array(rig)) return RecordedArray{*std::move(ideal), true};
  std::vector<int> all(rig.cameras.size());
  std::iota(all.begin(), all.end(), 0);
  auto inscribed = inscribed_wall_eyed_array(rig, make_topology(rig, all), reason);
  if (!inscribed) return std::nullopt;
  return RecordedArray{*std::move(inscribed), false};
}

}  // namespace raystage::rig
