// SPDX-License-Identifier: Apache-2.0
#include "planning/coverage_views.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

namespace raystage::planning {
namespace {

constexpr double kRadiansOfDegree = std::numbers::pi / 180;
constexpr int kViewWidth = 1024;  // shares are areas and do not depend on it

}  // namespace

std::vector<Eigen::Matrix3d> view_rotations(const CoverageOptions& options, double step_deg) {
  std::vector<double> yaws{options.yaw_deg};
  if (options.max_yaw_deg > 0) {
    const int steps = std::max(1, static_cast<int>(std::ceil(options.max_yaw_deg / step_deg)));
    for (int i = 1; i <= steps; ++i) {
      const double turn = options.max_yaw_deg * i / steps;
      yaws.insert(yaws.end(), {options.yaw_deg - turn, options.yaw_deg + turn});
    }
  }
  std::vector<Eigen::Matrix3d> rotations;
  for (const double yaw : yaws) {
    rotations.emplace_back(
        Eigen::AngleAxisd(yaw * kRadiansOfDegree, Eigen::Vector3d::UnitY()) *
        Eigen::AngleAxisd(options.pitch_deg * kRadiansOfDegree, Eigen::Vector3d::UnitX()));
  }
  return rotations;
}

render::VirtualCamera coverage_view(double fov_deg, double aspect) {
  return render::virtual_camera_with_fov(kViewWidth,
                                         std::max(1, static_cast<int>(kViewWidth / aspect)),
                                         fov_deg * kRadiansOfDegree, {});
}

}  // namespace raystage::planning
