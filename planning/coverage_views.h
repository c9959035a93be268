// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "planning/coverage_plan.h"
#include "render/common/view.h"

namespace raystage::planning {

/// Returns the rotations of the views in the array's frame: the middle and both ends of their yaw,
/// and others so that they are at most `step_deg` apart; or that of the given view.
std::vector<Eigen::Matrix3d> view_rotations(const CoverageOptions& options,
                                            const Eigen::Matrix3d& world_from_array,
                                            double step_deg = 180);

/// Returns a view with a horizontal field of view, in the array's frame, at its origin; or the
/// given view.
render::VirtualCamera coverage_view(const CoverageOptions& options, double fov_deg);

/// Returns the horizontal fields of view whose ranges are computed, degrees.
std::vector<double> coverage_fovs(const CoverageOptions& options);

/// Returns why a range that was measured around `centre` is none: it is thinner than the tolerance,
/// metres. Empty: it is thick enough. `share`: of the rays, 0 to 1.
std::string why_too_thin(const ClosedSurface& surface, double tolerance, double share,
                         const Eigen::Vector3d& centre);

}  // namespace raystage::planning
