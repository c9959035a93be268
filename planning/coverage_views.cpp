// SPDX-License-Identifier: Apache-2.0
#include "planning/coverage_views.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <numbers>

namespace raystage::planning {
namespace {

constexpr double kViewRadians = std::numbers::pi / 180;
constexpr int kViewWidth = 1024;  // shares are areas and do not depend on it

}  // namespace

std::vector<Eigen::Matrix3d> view_rotations(const CoverageOptions& options) {
  std::vector<double> yaws{options.yaw_deg};
  if (options.max_yaw_deg > 0) {
    yaws.insert(yaws.end(),
                {options.yaw_deg - options.max_yaw_deg, options.yaw_deg + options.max_yaw_deg});
  }
  std::vector<Eigen::Matrix3d> rotations;
  for (const double yaw : yaws) {
    rotations.emplace_back(
        Eigen::AngleAxisd(yaw * kViewRadians, Eigen::Vector3d::UnitY()) *
        Eigen::AngleAxisd(options.pitch_deg * kViewRadians, Eigen::Vector3d::UnitX()));
  }
  return rotations;
}

render::VirtualCamera coverage_view(double fov_deg, double aspect) {
  return render::virtual_camera_with_fov(
      kViewWidth, std::max(1, static_cast<int>(kViewWidth / aspect)), fov_deg * kViewRadians, {});
}

}  // namespace raystage::planning
