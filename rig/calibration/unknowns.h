// SPDX-License-Identifier: Apache-2.0
// Inside rig/calibration only: what a bundle adjustment was free to change, as one vector.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "rig/calibration/uncertainty.h"

namespace raystage {

inline constexpr int kPoseValues = 6;  ///< turn in the camera, place in the world
inline constexpr Eigen::Index kHeld = -1;

/// Where each camera's unknowns stand among all.
struct Layout {
  std::vector<Eigen::Index> pose, lens;  // kHeld: none
  std::vector<int> lens_values;          // which of LensValues
  bool fy_follows = false;
  Eigen::Index size = 0;
};

Layout layout_of(const ArrayModel& model, const BundleSettings& free);

/// What makes one tolerance of each unknown.
Eigen::VectorXd tolerances_of(const ArrayModel& model, const Layout& layout, const Tolerances& t);

/// Largest change, in tolerances, of anything that a direction (itself in tolerances) moves. Terms
/// of the distortion may cancel: what counts is what they do to the picture.
double largest_effect(const Eigen::VectorXd& direction, const Layout& layout);

/// What changes together in a direction, in tolerances, with this deviation.
Uncertainty::Direction described(const Eigen::VectorXd& direction, double deviation,
                                 const Layout& layout);

}  // namespace raystage
