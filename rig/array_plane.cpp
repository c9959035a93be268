// SPDX-License-Identifier: Apache-2.0
// Fits a plane to the camera centres of an array by principal component analysis (eigenvectors of
// the 3x3 covariance). The second direction is that of the residuals of the first, which is exact
// even for nearly collinear arrays. Real rows scatter about their line by millimetres; triangles of
// them would be slivers, outside of which no ray is seen. Such an array counts as collinear, and a
// camera next to another one (a pair behind a beam splitter) changes neither that nor the order of
// the row. Input: n centres (world, metres) and n unit viewing directions. Output: axes, distinct
// centres, and their coordinates in the plane, snapped to integer multiples of 2^-26 of the extent
// for exact predicates. Cost: O(n^2), from coincidence tests.
#include "rig/array_plane.h"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>

#include "base/error.h"
#include "rig/camera_stations.h"

namespace raystage::rig {
namespace {

constexpr double kCoincident = 1e-9;
constexpr double kCollinear = 1e-7;
constexpr double kRowScatter = 0.1;        // of the smallest spacing along the row
constexpr double kGridUnits = 67108864.0;  // 2^26 in the extent

using Points = std::vector<Eigen::Vector3d>;

// Returns v or -v, whichever has a positive largest component: an eigenvector's sign is arbitrary.
Eigen::Vector3d with_largest_positive(const Eigen::Vector3d& v) {
  Eigen::Index largest = 0;
  v.cwiseAbs().maxCoeff(&largest);
  return v(largest) < 0 ? Eigen::Vector3d(-v) : v;
}

// Returns the unit vector perpendicular to `normal` that is closest to a world axis, so that rows
// and columns parallel to world axes stay exact.
Eigen::Vector3d world_axis_across(const Eigen::Vector3d& normal, int axis) {
  const int other = axis == 0 ? 1 : 0;
  const Eigen::Vector3d chosen = Eigen::Vector3d::Unit(std::abs(normal(axis)) < 0.9 ? axis : other);
  return (chosen - normal * normal.dot(chosen)).normalized();
}

Eigen::Vector3d main_direction(const Points& points) {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& p : points) mean += p;
  mean /= static_cast<double>(points.size());
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  for (const Eigen::Vector3d& p : points) covariance += (p - mean) * (p - mean).transpose();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(covariance);
  return solver.eigenvectors().col(2).normalized();
}

double largest_spread(const Points& points) {
  double spread = 0;
  for (const Eigen::Vector3d& p : points) spread = std::max(spread, (p - points[0]).norm());
  return spread;
}

// Returns the centres without their component along `direction`.
Points across(const Points& points, const Eigen::Vector3d& direction) {
  Points result;
  for (const Eigen::Vector3d& p : points) result.push_back(p - direction * direction.dot(p));
  return result;
}

// Returns the largest distance of a point from the line along `direction` through their mean.
double distance_from_line(const Points& points, const Eigen::Vector3d& direction) {
  const Points flat = across(points, direction);
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& p : flat) mean += p;
  mean /= static_cast<double>(flat.size());
  double distance = 0;
  for (const Eigen::Vector3d& p : flat) distance = std::max(distance, (p - mean).norm());
  return distance;
}

// Returns the largest distance of two points perpendicular to `direction`.
double extent_across(const Points& points, const Eigen::Vector3d& direction) {
  const Points flat = across(points, direction);
  double extent = 0;
  for (std::size_t i = 0; i < flat.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j) extent = std::max(extent, (flat[i] - flat[j]).norm());
  }
  return extent;
}

// Returns the smallest distance of two points along `direction`.
double smallest_spacing(const Points& points, const Eigen::Vector3d& direction) {
  std::vector<double> along;
  for (const Eigen::Vector3d& p : points) along.push_back(direction.dot(p));
  std::ranges::sort(along);
  double spacing = std::numeric_limits<double>::infinity();
  for (std::size_t i = 1; i < along.size(); ++i) {
    spacing = std::min(spacing, along[i] - along[i - 1]);
  }
  return spacing;
}

template <class Value>
std::vector<Value> selected(const std::vector<Value>& values, std::span<const int> indices) {
  std::vector<Value> result;
  for (const int index : indices) result.push_back(values[index]);
  return result;
}

/// `stations`: those of the points that stand for their station.
bool is_row(const Points& points, const Points& stations, const Eigen::Vector3d& direction) {
  return distance_from_line(points, direction) < kCollinear ||
         extent_across(points, direction) < kRowScatter * smallest_spacing(stations, direction);
}

void keep_distinct_snapped(ArrayPlane& plane, const Points& scaled) {
  std::vector<int> distinct;
  for (std::size_t i = 0; i < scaled.size(); ++i) {
    const GridPoint point{std::llround(plane.along.dot(scaled[i]) * kGridUnits),
                          std::llround(plane.up.dot(scaled[i]) * kGridUnits)};
    if (std::ranges::find(plane.snapped, point) != plane.snapped.end()) continue;
    plane.snapped.push_back(point);
    distinct.push_back(plane.distinct[i]);
  }
  plane.distinct = std::move(distinct);
}

}  // namespace

ArrayPlane fit_array_plane(std::span<const Eigen::Vector3d> centres,
                           std::span<const Eigen::Vector3d> viewing_directions) {
  assert(centres.size() == viewing_directions.size());
  if (centres.empty()) {
    throw Error::bad_input("the topology needs at least one camera", "rig",
                           "Keep at least one camera");
  }
  Eigen::AlignedBox3d box;
  Eigen::Vector3d viewing = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < centres.size(); ++i) {
    if (!centres[i].allFinite() || !viewing_directions[i].allFinite()) {
      throw Error::bad_input("camera " + std::to_string(i) + " has a pose that is not finite",
                             "rig", "Check the calibration");
    }
    box.extend(centres[i]);
    viewing += viewing_directions[i];
  }
  const double extent = box.diagonal().norm();
  const Eigen::Vector3d towards_back =
      viewing.norm() > 1e-9 ? Eigen::Vector3d(-viewing.normalized()) : -viewing_directions[0];

  ArrayPlane plane;
  Points scaled;  // distinct centres relative to the first, in units of the extent
  for (std::size_t i = 0; i < centres.size(); ++i) {
    const Eigen::Vector3d p =
        extent > 0 ? Eigen::Vector3d((centres[i] - centres[0]) / extent) : Eigen::Vector3d::Zero();
    const bool repeated = std::ranges::any_of(
        scaled, [&](const Eigen::Vector3d& q) { return (p - q).norm() < kCoincident; });
    if (repeated) continue;
    scaled.push_back(p);
    plane.distinct.push_back(static_cast<int>(i));
  }

  if (scaled.size() == 1) {
    plane.normal = towards_back;
    plane.along = world_axis_across(plane.normal, 0);
    plane.up = plane.normal.cross(plane.along);
    plane.snapped = {GridPoint{}};
    return plane;
  }

  const Eigen::Vector3d line = with_largest_positive(main_direction(scaled));
  const std::vector<int> firsts = first_of_stations(scaled);
  const Points stations = selected(scaled, firsts);
  if (is_row(scaled, stations, line)) {
    plane.dimension = 1;
    plane.along = line;
    const Eigen::Vector3d back = towards_back - line * line.dot(towards_back);
    plane.normal =
        back.norm() > 1e-9 ? Eigen::Vector3d(back.normalized()) : world_axis_across(line, 2);
    plane.up = plane.normal.cross(plane.along);
    plane.distinct = selected(plane.distinct, firsts);
    keep_distinct_snapped(plane, stations);
    return plane;
  }

  plane.dimension = 2;
  Points rest = across(scaled, line);
  const double spread = largest_spread(rest);
  for (Eigen::Vector3d& p : rest) p /= spread;
  plane.normal = with_largest_positive(line.cross(main_direction(rest)).normalized());
  if (plane.normal.dot(towards_back) < 0) plane.normal = -plane.normal;
  plane.along = world_axis_across(plane.normal, 0);
  plane.up = plane.normal.cross(plane.along);
  keep_distinct_snapped(plane, scaled);
  return plane;
}

}  // namespace raystage::rig
