// SPDX-License-Identifier: Apache-2.0
#include "rig/planning/array_design.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace raystage::rig {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

/// Returns the extreme values of a range, and `other` where it is inside.
std::vector<double> extremes_of(const std::pair<double, double>& range, double other) {
  std::vector<double> values{range.first, range.second};
  if (range.first < other && range.second > other) values.push_back(other);
  return values;
}

/// Returns the angles of yaw at which a ray of a view, turned by its pitch alone, is most inclined
/// along an axis of the array: the ends of the range; where it is in the array's yz plane, and
/// least inclined along y; and 0, where the eyes of a stereo camera are farthest apart.
std::vector<double> extreme_yaws(const std::pair<double, double>& range, const Vector3d& ray) {
  std::vector<double> yaws = extremes_of(range, 0);
  const double across = std::atan2(ray.x(), -ray.z());
  if (range.first < across && range.second > across) yaws.push_back(across);
  return yaws;
}

}  // namespace

std::optional<ArrayRequirements> array_requirements(std::span<const PlannedView> views,
                                                    const PlannedPicture& picture) {
  const double half_width = std::tan(picture.horizontal_fov / 2);
  const double half_height = half_width / picture.aspect;
  ArrayRequirements needed;
  double widest = 0, highest = 0;  // slopes
  for (const PlannedView& view : views) {
    for (const double pitch : extremes_of(view.pitch, 0)) {
      for (const double x : {-half_width, half_width}) {
        for (const double y : {-half_height, half_height}) {
          const Vector3d pitched = Eigen::AngleAxisd(pitch, Vector3d::UnitX()) * Vector3d(x, y, -1);
          for (const double yaw : extreme_yaws(view.yaw, pitched)) {
            const Eigen::Matrix3d turn =
                Eigen::AngleAxisd(yaw, Vector3d::UnitY()).toRotationMatrix();
            const Vector3d ray = turn * pitched;
            if (!(ray.z() < 0)) return std::nullopt;
            const Vector2d slope = ray.head<2>() / -ray.z();
            widest = std::max(widest, std::abs(slope.x()));
            highest = std::max(highest, std::abs(slope.y()));
            for (const double eye : {-picture.interaxial / 2, picture.interaxial / 2}) {
              const Vector3d at = view.position + eye * turn.col(0);
              needed.extent.extend(Vector2d(at.head<2>() + at.z() * slope));
            }
          }
        }
      }
    }
  }
  needed.horizontal_fov = 2 * std::atan(widest);
  needed.vertical_fov = 2 * std::atan(highest);
  return needed;
}

double largest_spacing(double pitch, schemas::DepthRange scene, double error) {
  const double depths = 1 / scene.near - 1 / scene.far;
  return depths > 0 ? 2 * error * pitch / depths : std::numeric_limits<double>::infinity();
}

double ghosting_at_spacing(double pitch, schemas::DepthRange scene, double spacing) {
  return spacing * (1 / scene.near - 1 / scene.far) / (2 * pitch);
}

std::optional<double> fov_of_rotated_cameras(const Eigen::AlignedBox2d& extent, double depth,
                                             double radius) {
  // The nearest camera, that in the middle, sees the sphere under the largest angle.
  if (extent.isEmpty() || !(depth > radius)) return std::nullopt;
  return 2 * std::asin(radius / depth);
}

}  // namespace raystage::rig
