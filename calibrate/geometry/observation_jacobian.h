// SPDX-License-Identifier: Apache-2.0
// Internal to calibrate/geometry: derivatives of observations, and the normal equations of all
// parameters but the points.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "calibrate/geometry/parameter_layout.h"

namespace raystage::calibrate {

/// Returns the matrix of the cross product with `v`.
Eigen::Matrix3d cross_matrix(const Eigen::Vector3d& v);

/// Jacobian rows of one observation: its parameters, and the derivatives by them and by its point.
struct ObservationRows {
  std::vector<Eigen::Index> unknowns;
  Eigen::Matrix<double, 2, Eigen::Dynamic> by_unknowns;
  Eigen::Matrix<double, 2, 3> by_point;
};

/// Returns the rows of an observation that is used, by the free parameters of its pose and lens.
ObservationRows observation_rows(const ArrayModel& model, const ArrayModel::Observation& o,
                                 const ParameterLayout& layout);

/// Normal equations of the parameters after points or bodies are eliminated (reduced camera
/// system), for noise of one pixel.
struct ReducedNormalEquations {
  explicit ReducedNormalEquations(Eigen::Index size)
      : matrix(Eigen::MatrixXd::Zero(size, size)), right(Eigen::VectorXd::Zero(size)) {}

  /// Adds observations that share parameters to be eliminated: a point or a body. `by_common`:
  /// derivatives of all rows by these; `residuals`: of the observations, pixels.
  void add(const std::vector<ObservationRows>& rows, const Eigen::MatrixXd& by_common,
           std::span<const Eigen::Vector2d> residuals);

  Eigen::MatrixXd matrix;
  Eigen::VectorXd right;                 ///< derivatives times residuals
  int observations = 0, eliminated = 0;  ///< number of observations; of eliminated parameters
  double squared_error = 0;              ///< sum over the residuals, pixels squared
};

}  // namespace raystage::calibrate
