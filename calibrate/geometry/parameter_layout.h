// SPDX-License-Identifier: Apache-2.0
// Inside calibrate/geometry only: what a bundle adjustment was free to change, as one vector.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "calibrate/geometry/uncertainty.h"

namespace raystage {

inline constexpr int kPoseParameterCount = 6;  ///< turn in the camera, position in the world
inline constexpr Eigen::Index kFixed = -1;

/// Where each camera's unknowns stand among all.
struct ParameterLayout {
  std::vector<Eigen::Index> pose, lens;   // kFixed: none
  std::vector<int> free_lens_parameters;  // which of LensParameters
  bool square_pixels = false;
  Eigen::Index size = 0;
};

ParameterLayout make_parameter_layout(const ArrayModel& model,
                                      const BundleAdjustmentSettings& free);

/// What makes one tolerance of each unknown.
Eigen::VectorXd parameter_tolerances(const ArrayModel& model, const ParameterLayout& layout,
                                     const Tolerances& t);

/// Largest change, in tolerances, of anything that a direction (itself in tolerances) moves. Terms
/// of the distortion may cancel: what counts is what they do to the picture.
double max_effect(const Eigen::VectorXd& direction, const ParameterLayout& layout);

/// What changes together in a direction, in tolerances, with this deviation.
Uncertainty::Direction summarise_direction(const Eigen::VectorXd& direction, double deviation,
                                           const ParameterLayout& layout);

}  // namespace raystage
