// SPDX-License-Identifier: Apache-2.0
// Internal to calibrate/geometry: the free parameters of a bundle adjustment as one vector.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "calibrate/geometry/uncertainty.h"

namespace raystage::calibrate {

inline constexpr int kPoseParameterCount = 6;  ///< rotation in the camera, position in the world
inline constexpr Eigen::Index kFixed = -1;

/// Index of each camera's first parameters in the vector.
struct ParameterLayout {
  std::vector<Eigen::Index> pose, lens;  // kFixed: held
  /// which of LensParameters, by camera; also of cameras whose lens is held
  std::vector<std::vector<int>> free_lens_parameters;
  std::vector<schemas::Projection> projections;  // by camera
  bool square_pixels = false;
  Eigen::Index size = 0;
};

ParameterLayout make_parameter_layout(const ArrayModel& model, const BundleAdjustmentOptions& free);

/// Returns the size of one tolerance for each parameter.
Eigen::VectorXd parameter_tolerances(const ArrayModel& model, const ParameterLayout& layout,
                                     const Tolerances& t);

/// Returns the largest effect of a direction (a change of all parameters, in tolerances) on any
/// quantity, in tolerances. Distortion terms that compensate each other count by their joint effect
/// on the picture.
double max_effect(const Eigen::VectorXd& direction, const ParameterLayout& layout);

/// Returns what changes together in a direction, which is in tolerances and has this deviation.
Uncertainty::Direction summarise_direction(const Eigen::VectorXd& direction, double deviation,
                                           const ParameterLayout& layout);

}  // namespace raystage::calibrate
