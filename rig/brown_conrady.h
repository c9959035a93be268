// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <optional>

#include "schemas/geometry.h"

namespace raystage::rig {

/// Brown-Conrady distortion of ideal image points (x/z, y/z, y down; OpenCV's coefficients k1, k2,
/// p1, p2, k3).

/// Returns the ideal radius at which the distortion folds back, or infinity.
double fold_radius(const schemas::Distortion& d);
/// Returns the distorted point, also beyond the fold.
Eigen::Vector2d distort(const schemas::Distortion& d, const Eigen::Vector2d& ideal);
/// Returns the ideal point within the radius `limit` whose distorted point differs from `distorted`
/// by at most `tolerance`, or nullopt if there is none.
std::optional<Eigen::Vector2d> undistort(const schemas::Distortion& d,
                                         const Eigen::Vector2d& distorted, double limit,
                                         double tolerance);

}  // namespace raystage::rig
