// SPDX-License-Identifier: Apache-2.0
// Bounds the image of a set of directions in a fisheye. Combinations of directions lie on great
// circles between them, whose images leave their chords by at most bend * length^2 / 8
// (FisheyeFit::bend): once for the border of a quadrilateral, whose image bounds that of its
// inside, and twice for arbitrary sets. At the largest angle the box is that of a cap about all
// directions. Cost: constant per corner.
#include "render/sampling/fisheye_footprint.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

namespace raystage::render {
namespace {

/// Farther apart, radians, bounds are useless.
constexpr double kLargestRadius = 0.4;
/// Straight backwards the image of a direction is a circle.
constexpr double kFarthest = 0.97 * std::numbers::pi;

double angle_to_axis(const Eigen::Vector3d& direction) {
  return std::atan2(direction.head<2>().norm(), direction.z());
}

}  // namespace

Eigen::Vector2d fisheye_position(const SourceView& source, const Eigen::Vector3d& direction) {
  const FisheyeFit& fit = source.fisheye;
  const double across = direction.head<2>().norm();
  const double part = std::min(
      1.0, std::pow(angle_to_axis(direction), 2) * static_cast<double>(fit.per_largest_squared));
  const double angle = std::sqrt(part / static_cast<double>(fit.per_largest_squared));
  double distance_per_angle = 0;
  for (int i = FisheyeFit::kTerms - 1; i >= 0; --i) {
    distance_per_angle = distance_per_angle * (2 * part - 1) +
                         static_cast<double>(fit.distance_per_angle[static_cast<std::size_t>(i)]);
  }
  const Eigen::Vector2d image =
      across > 0 ? Eigen::Vector2d(direction.head<2>() * (distance_per_angle * angle / across))
                 : Eigen::Vector2d::Zero();
  return {image.x() * static_cast<double>(source.fx) + static_cast<double>(source.cx),
          image.y() * static_cast<double>(source.fy) + static_cast<double>(source.cy)};
}

FisheyeFootprint fisheye_footprint(const SourceView& source,
                                   std::span<const Eigen::Vector3d> corners, bool is_flat) {
  FisheyeFootprint footprint;
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& corner : corners) centre += corner.normalized();
  double radius = 0;  // of a cap about all corners, radians
  for (const Eigen::Vector3d& corner : corners) {
    radius = std::max(radius, std::atan2(centre.cross(corner).norm(), centre.dot(corner)));
  }
  if (!centre.allFinite() || !(radius <= kLargestRadius)) return footprint;
  const double limit = 1 / std::sqrt(static_cast<double>(source.fisheye.per_largest_squared));
  const double at = angle_to_axis(centre);
  if (at - radius > limit) {
    footprint.place = FisheyeFootprint::Place::kUnseen;
    return footprint;
  }
  if (at + radius > kFarthest) return footprint;
  footprint.place = FisheyeFootprint::Place::kSeen;
  footprint.is_at_limit = at + radius > limit;
  const double focal = static_cast<double>(std::max(source.fx, source.fy));
  if (footprint.is_at_limit) {
    // Beyond the limit an arc may be longer than within.
    constexpr double kDetour = 1.5;
    const Eigen::Vector2d middle = fisheye_position(source, centre);
    const double reach = kDetour * (radius + std::max(0.0, at - limit)) * focal *
                         static_cast<double>(source.fisheye.largest_slope);
    footprint.margin = 2 * reach;  // the corners are as far from the middle
    footprint.left = middle.x() - reach;
    footprint.right = middle.x() + reach;
    footprint.top = middle.y() - reach;
    footprint.bottom = middle.y() + reach;
    return footprint;
  }
  Eigen::Vector2d low = fisheye_position(source, corners.front()), high = low;
  for (const Eigen::Vector3d& corner : corners) {
    const Eigen::Vector2d pixel = fisheye_position(source, corner);
    low = low.cwiseMin(pixel);
    high = high.cwiseMax(pixel);
  }
  const double bend = static_cast<double>(source.fisheye.bend) * focal * radius * radius / 2;
  footprint.margin = is_flat ? bend : 2 * bend;
  footprint.left = low.x() - footprint.margin;
  footprint.right = high.x() + footprint.margin;
  footprint.top = low.y() - footprint.margin;
  footprint.bottom = high.y() + footprint.margin;
  return footprint;
}

}  // namespace raystage::render
