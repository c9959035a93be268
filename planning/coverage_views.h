// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <vector>

#include "planning/coverage_plan.h"
#include "render/common/view.h"

namespace raystage::planning {

/// Returns the rotations of the views in the array's frame: the middle and both ends of their yaw,
/// and others so that they are at most `step_deg` apart.
std::vector<Eigen::Matrix3d> view_rotations(const CoverageOptions& options, double step_deg = 180);

/// Returns a view with a horizontal field of view, in the array's frame, at its origin.
render::VirtualCamera coverage_view(double fov_deg, double aspect);

}  // namespace raystage::planning
