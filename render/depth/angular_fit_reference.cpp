// SPDX-License-Identifier: Apache-2.0
// Reference of angular_fit_kernels.cpp: weighted least squares of a quadratic polynomial, one pixel
// in double. Cost: O(cameras x terms^2 + terms^3).
#include <Eigen/Cholesky>
#include <Eigen/Core>

#include "render/depth/angular_fit_kernels.h"

namespace raystage::render {

AngularFitOfPixel fit_angular_reference(std::span<const AngularSample> samples) {
  using Terms = Eigen::Matrix<double, kAngularTerms, 1>;
  Eigen::Matrix<double, kAngularTerms, kAngularTerms> normal;
  Eigen::Matrix<double, kAngularTerms, 3> right;
  normal.setZero();
  right.setZero();
  Eigen::RowVector3d mean(0, 0, 0);
  double weights = 0, seen = 0;
  for (const AngularSample& s : samples) {
    mean += s.weight * Eigen::RowVector3d(s.code[0], s.code[1], s.code[2]);
    weights += s.weight;
    seen += s.seen;
  }
  AngularFitOfPixel result;
  if (!(weights > static_cast<double>(kMinAngularWeight))) return result;
  mean /= weights;
  double squares = 0;
  for (const AngularSample& s : samples) {
    const Terms terms{1, s.x, s.y, s.x * s.x, s.x * s.y, s.y * s.y};
    const Eigen::RowVector3d off = Eigen::RowVector3d(s.code[0], s.code[1], s.code[2]) - mean;
    normal += s.weight * terms * terms.transpose();
    right += s.weight * terms * off;
    squares += s.weight * off.squaredNorm();
  }
  for (int i = 1; i < kAngularTerms; ++i) {
    normal(i, i) += static_cast<double>(kAngularRidge) * weights;
  }
  const auto factors = normal.ldlt();
  const Eigen::Matrix<double, kAngularTerms, 3> found = factors.solve(right);
  const Terms constant = factors.solve(Terms::Unit(0));
  result.is_valid = seen >= static_cast<double>(kMinAngularCameras) &&
                    constant[0] * weights <= static_cast<double>(kMaxAngularGain);
  if (!result.is_valid) return result;
  const Eigen::RowVector3d code = mean + found.row(0);
  result.code = {code[0], code[1], code[2]};
  result.difference = found.row(0).squaredNorm() / 3;
  const double residual = (squares - found.cwiseProduct(right).sum()) / 3;
  result.noise = residual / (seen - kAngularTerms) * (constant[0] - 1 / weights);
  return result;
}

}  // namespace raystage::render
