// SPDX-License-Identifier: Apache-2.0
#include "planning/coverage_views.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

namespace raystage::planning {
namespace {

constexpr double kRadiansOfDegree = std::numbers::pi / 180;
constexpr int kViewWidth = 1024;  // shares are areas and do not depend on it

}  // namespace

std::vector<Eigen::Matrix3d> view_rotations(const CoverageOptions& options,
                                            const Eigen::Matrix3d& world_from_array,
                                            double step_deg) {
  if (options.view) {
    return {world_from_array.transpose() * options.view->pose.world_from_camera_rotation};
  }
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

render::VirtualCamera coverage_view(const CoverageOptions& options, double fov_deg) {
  if (options.view) return *options.view;
  return render::virtual_camera_with_fov(kViewWidth,
                                         std::max(1, static_cast<int>(kViewWidth / options.aspect)),
                                         fov_deg * kRadiansOfDegree, {});
}

std::vector<double> coverage_fovs(const CoverageOptions& options) {
  constexpr double kAllAround = 360;
  if (options.all_directions) return {kAllAround};
  if (!options.view) return options.view_fov_deg;
  const double half = options.view->width / 2.0 / options.view->intrinsics.fx;
  return {2 * std::atan(half) / kRadiansOfDegree};
}

std::string why_too_thin(const ClosedSurface& surface, double tolerance, double share,
                         const Eigen::Vector3d& centre) {
  Eigen::AlignedBox3d around;
  for (const Eigen::Vector3d& vertex : surface.vertices) around.extend(vertex);
  if (around.sizes().minCoeff() >= tolerance) return {};
  return fmt::format(
      "the range with {:.4g} % of the rays is thinner than the tolerance, around ({:.3f}, {:.3f}, "
      "{:.3f})",
      100 * share, centre.x(), centre.y(), centre.z());
}

}  // namespace raystage::planning
