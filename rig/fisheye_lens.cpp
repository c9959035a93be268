// SPDX-License-Identifier: Apache-2.0
// Fisheye lenses: OpenCV's cv::fisheye, the f-theta, equisolid and orthographic lenses of
// facebook360_dep. The end of the distortion is the first root of its derivative; its inverse uses
// Newton's method within a shrinking bracket, and bisects where its steps do not shrink. Angles
// come from atan2, which is accurate from the axis to the opposite direction. Cost: a few
// iterations per point.
#include "rig/fisheye_lens.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "rig/polynomial.h"

namespace raystage::rig {
namespace {

// Beyond this relative margin a ray is outside: image points at the very end project again.
constexpr double kEndMargin = 1e-12;
// Newton's steps below this, relative to the bracket's end, are left to converge.
constexpr double kSmallStep = 1e-3;

double distorted(const std::array<double, 4>& k, double r) {
  const double s = r * r;
  return r * (1 + s * (k[0] + s * (k[1] + s * (k[2] + s * k[3]))));
}

double distortion_slope(const std::array<double, 4>& k, double r) {
  const double s = r * r;
  return 1 + s * (3 * k[0] + s * (5 * k[1] + s * (7 * k[2] + s * 9 * k[3])));
}

}  // namespace

FisheyeLens::FisheyeLens(const schemas::Intrinsics& intrinsics)
    : projection_(&radial_projection(intrinsics.projection)),
      distortion_(intrinsics.radial_distortion) {
  largest_angle_ =
      std::min(projection_->largest_angle(),
               intrinsics.half_angle.value_or(std::numeric_limits<double>::infinity()));
  largest_undistorted_ = projection_->distance(largest_angle_);
  const std::array<double, 4>& k = distortion_;
  const auto ends =
      sign_changes({1, 0, 3 * k[0], 0, 5 * k[1], 0, 7 * k[2], 0, 9 * k[3]}, largest_undistorted_);
  if (!ends.empty()) {
    largest_undistorted_ = ends.front();
    largest_angle_ = projection_->angle(largest_undistorted_);
  }
  largest_distance_ = distorted(distortion_, largest_undistorted_);
}

double FisheyeLens::distance(double angle) const {
  return distorted(distortion_, projection_->distance(angle));
}

double FisheyeLens::slope(double angle) const {
  return distortion_slope(distortion_, projection_->distance(angle)) * projection_->slope(angle);
}

std::optional<double> FisheyeLens::angle(double distance) const {
  if (!(distance <= largest_distance_ * (1 + kEndMargin))) return std::nullopt;
  double low = 0, high = largest_undistorted_;
  double r = std::min(distance, high);
  double last_step = high;
  for (int step = 0; step < 200; ++step) {
    const double excess = distorted(distortion_, r) - distance;
    if (excess == 0) break;
    (excess > 0 ? high : low) = r;
    double next = r - excess / distortion_slope(distortion_, r);
    // Large steps that do not shrink alternate about the solution, within the bracket.
    const bool alternates = std::abs(next - r) > std::max(last_step / 2, kSmallStep * high);
    if (!(next > low && next < high) || alternates) next = low + (high - low) / 2;
    if (next == r || !(next > low && next < high)) break;
    last_step = std::abs(next - r);
    r = next;
  }
  return std::min(projection_->angle(r), largest_angle_);
}

std::optional<Eigen::Vector2d> FisheyeLens::image_from_direction(
    const Eigen::Vector3d& direction) const {
  if (!direction.allFinite()) return std::nullopt;
  const double across = std::hypot(direction.x(), direction.y());
  if (across == 0 && direction.z() == 0) return std::nullopt;
  const double angle = std::atan2(across, direction.z());
  if (angle > largest_angle_ * (1 + kEndMargin)) return std::nullopt;
  // Straight backwards, the direction across is unknown.
  if (across == 0) {
    if (direction.z() < 0) return std::nullopt;
    return Eigen::Vector2d::Zero();
  }
  return Eigen::Vector2d(direction.head<2>() / across * distance(std::min(angle, largest_angle_)));
}

std::optional<Eigen::Vector3d> FisheyeLens::direction_from_image(
    const Eigen::Vector2d& point) const {
  const double distance = std::hypot(point.x(), point.y());
  const auto found = angle(distance);
  if (!found) return std::nullopt;
  if (distance == 0) return Eigen::Vector3d::UnitZ();
  const double across = std::sin(*found);
  return Eigen::Vector3d(across * point.x() / distance, across * point.y() / distance,
                         std::cos(*found));
}

}  // namespace raystage::rig
