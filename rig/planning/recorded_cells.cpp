// SPDX-License-Identifier: Apache-2.0
// The directions from a position P that pass between three cameras at C1, C2, C3 are bounded by the
// planes through P and the sides of their triangle, in front of P or behind it. What a camera sees
// at the horizon does not depend on P: directions within the outline of its picture. With lens
// distortion the outline is a polygon whose corners are close enough, and it need not be convex: it
// is its convex hull without the pockets between. Cost: some 10 microseconds for a direction
// polygon that a cell crosses.
#include "rig/planning/recorded_cells.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <iterator>
#include <optional>
#include <span>
#include <utility>

#include "rig/planning/wall_eyed_array.h"

namespace raystage::rig {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

/// Returns the ideal image point of a pixel on the border of a picture. Where the distortion folds
/// back before it, that of the outermost pixel on the way there.
std::optional<Vector2d> border_point(const CameraModel& camera, const Vector2d& pixel) {
  if (const auto found = camera.ideal_from_pixel(pixel)) return found;
  const Vector2d middle(camera.width() / 2.0, camera.height() / 2.0);
  std::optional<Vector2d> innermost = camera.ideal_from_pixel(middle);
  if (!innermost) return std::nullopt;
  double inside = 0, outside = 1;
  constexpr int kSteps = 40;
  for (int step = 0; step < kSteps; ++step) {
    const double at = (inside + outside) / 2;
    if (const auto found = camera.ideal_from_pixel(middle + at * (pixel - middle))) {
      innermost = found;
      inside = at;
    } else {
      outside = at;
    }
  }
  return innermost;
}

/// Returns the outline of a picture in ideal image points, with straight lines between them; empty
/// where no ray reaches the picture's middle.
std::vector<Vector2d> ideal_outline(const CameraModel& camera) {
  const double width = camera.width(), height = camera.height();
  const std::array<Vector2d, 4> corners{Vector2d(0, 0), Vector2d(width, 0), Vector2d(width, height),
                                        Vector2d(0, height)};
  constexpr double kTolerancePixels = 0.02;
  constexpr int kMostParts = 256;  // of a side
  const double tolerance =
      kTolerancePixels / std::max(camera.intrinsics().fx, camera.intrinsics().fy);
  std::vector<Vector2d> outline;
  for (std::size_t side = 0; side < 4; ++side) {
    const Vector2d &from = corners[side], &to = corners[(side + 1) % 4];
    for (int parts = 1; parts <= kMostParts; parts *= 2) {
      std::vector<Vector2d> points;
      double deviation = 0;
      for (int i = 0; i < 2 * parts; ++i) {  // every second one is the middle of a part
        const auto point = border_point(camera, from + i / (2.0 * parts) * (to - from));
        if (!point) return {};
        points.push_back(*point);
      }
      const auto last = border_point(camera, to);
      if (!last) return {};
      points.push_back(*last);
      for (std::size_t i = 1; i < points.size(); i += 2) {
        deviation = std::max(deviation, (points[i] - (points[i - 1] + points[i + 1]) / 2).norm());
      }
      if (deviation > tolerance && parts < kMostParts) continue;
      for (std::size_t i = 0; i + 1 < points.size(); i += 2) outline.push_back(points[i]);
      break;
    }
  }
  return outline;
}

double area_of(std::span<const Vector2d> polygon) {
  double twice = 0;
  for (std::size_t i = 2; i < polygon.size(); ++i) {
    const Vector2d a = polygon[i - 1] - polygon[0], b = polygon[i] - polygon[0];
    twice += a.x() * b.y() - a.y() * b.x();
  }
  return std::abs(twice) / 2;
}

/// Returns the directions in a polygon of a camera's ideal image points.
DirectionSet directions_in(const Rig::Camera& camera, const std::vector<Vector2d>& polygon) {
  const auto direction = [&](const Vector2d& ideal) -> Vector3d {
    return camera.pose.world_from_camera_rotation * Vector3d(ideal.x(), -ideal.y(), -1);
  };
  const std::vector<Vector2d> hull = convex_hull(polygon, 0);
  Vector2d middle = Vector2d::Zero();
  for (const Vector2d& corner : hull) middle += corner / static_cast<double>(hull.size());
  DirectionSet set;
  set.hull.push_back(camera.pose.viewing_direction());
  for (std::size_t i = 0; i < hull.size(); ++i) {
    const Vector3d normal =
        direction(hull[i]).cross(direction(hull[(i + 1) % hull.size()])).normalized();
    set.hull.emplace_back(normal.dot(direction(middle)) < 0 ? -normal : normal);
  }
  // Between corners of the hull the polygon may be further inside.
  const auto is_of_hull = [&](const Vector2d& corner) {
    return std::ranges::find(hull, corner) != hull.end();
  };
  const std::size_t n = polygon.size();
  const std::size_t first = std::ranges::find_if(polygon, is_of_hull) - polygon.begin();
  std::vector<Vector2d> pocket{polygon[first]};
  const double smallest = 1e-12 * area_of(polygon);
  for (std::size_t i = 1; i <= n; ++i) {
    const Vector2d& corner = polygon[(first + i) % n];
    pocket.push_back(corner);
    if (!is_of_hull(corner)) continue;
    if (pocket.size() < n && area_of(pocket) > smallest) {
      set.pockets.push_back(directions_in(camera, pocket));
    }
    pocket = {corner};
  }
  return set;
}

void append(std::vector<DirectionPolygon>&& from, std::vector<DirectionPolygon>& to) {
  std::ranges::move(from, std::back_inserter(to));
}

/// Returns the parts of directions in a set.
std::vector<DirectionPolygon> inside(std::vector<DirectionPolygon> directions,
                                     const DirectionSet& set);

/// Returns the parts of directions outside a set.
std::vector<DirectionPolygon> outside(std::span<const DirectionPolygon> directions,
                                      const DirectionSet& set) {
  std::vector<DirectionPolygon> parts = without(directions, set.hull);
  if (set.pockets.empty()) return parts;
  const std::vector<DirectionPolygon> within_hull = within(directions, set.hull);
  for (const DirectionSet& pocket : set.pockets) append(inside(within_hull, pocket), parts);
  return parts;
}

std::vector<DirectionPolygon> inside(std::vector<DirectionPolygon> directions,
                                     const DirectionSet& set) {
  directions = within(directions, set.hull);
  for (const DirectionSet& pocket : set.pockets) directions = outside(directions, pocket);
  return directions;
}

}  // namespace

RecordedCells::RecordedCells(const Rig& rig, const Topology& topology) {
  if (topology.kind != Topology::Kind::kTriangles) return;
  for (const Rig::Camera& camera : rig.cameras) {
    centres_.push_back(camera.pose.position);
    const std::vector<Vector2d> outline = ideal_outline(camera.model);
    frusta_.push_back(outline.empty() ? std::nullopt
                                      : std::optional(directions_in(camera, outline)));
  }
  cells_ = topology.cells;
}

DividedDirections RecordedCells::divide(const Vector3d& position,
                                        std::vector<DirectionPolygon> directions) const {
  DividedDirections divided;
  for (const Topology::Cell& cell : cells_) {
    if (directions.empty()) break;
    std::array<Vector3d, 3> to;
    for (std::size_t i = 0; i < 3; ++i) to[i] = centres_[cell[i]] - position;
    std::vector<Vector3d> between;  // the cameras
    for (std::size_t i = 0; i < 3; ++i) between.emplace_back(to[i].cross(to[(i + 1) % 3]));
    for (int side = 0; side < 2; ++side) {  // in front of the position and behind it
      std::vector<DirectionPolygon> crossing = within(directions, between);
      if (!crossing.empty()) {
        directions = without(directions, between);
        for (const int camera : cell) {
          if (!frusta_[camera]) continue;
          append(inside(crossing, *frusta_[camera]), divided.recorded);
          crossing = outside(crossing, *frusta_[camera]);
        }
        // Of an array that is not flat, a line may cross another cell, whose cameras see it.
        append(std::move(crossing), directions);
      }
      for (Vector3d& normal : between) normal = -normal;
    }
  }
  divided.unrecorded = std::move(directions);
  return divided;
}

}  // namespace raystage::rig
