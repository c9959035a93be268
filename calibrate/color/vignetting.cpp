// SPDX-License-Identifier: Apache-2.0
// Fits the vignetting model to the cells of an evenly lit target: centre, three coefficients and
// the target's light. Method: robust non-linear least squares (Ceres, Cauchy's loss). Input: cell
// means, linear light; positions relative to half of the diagonal. Cost: cells per iteration.
#include "calibrate/color/vignetting.h"

#include <ceres/ceres.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "calibrate/geometry/ceres_options.h"

namespace raystage::calibrate {
namespace {

/// Residual: light of a cell minus the model, relative to the model.
struct CellError {
  double x, y, light;  // in half diagonals from the picture's centre

  template <typename T>
  bool operator()(const T* level, const T* centre, const T* a, T* error) const {
    const T across = x - centre[0], down = y - centre[1];
    const T r2 = across * across + down * down;
    const T gain = 1.0 + r2 * (a[0] + r2 * (a[1] + r2 * a[2]));
    error[0] = light * gain / level[0] - 1.0;
    return true;
  }
};

}  // namespace

VignettingFit fit_vignetting(std::span<const FlatFieldCell> cells, rig::PictureSize size,
                             const schemas::PhotometricResponse& response) {
  const double half_diagonal = std::hypot(size.width, size.height) / 2;
  double level = 0;
  std::array<double, 2> centre{0, 0};
  std::array<double, 3> a{0, 0, 0};
  ceres::Problem problem;
  std::vector<ceres::ResidualBlockId> blocks;
  for (const FlatFieldCell& cell : cells) {
    double light = 0;
    for (std::size_t c = 0; c < 3; ++c) {
      light += (response.brightness[c] + response.contrast[c] * cell.mean[c]) / 3;
    }
    level = std::max(level, light);
    constexpr double kCauchyScale = 0.01;
    blocks.push_back(problem.AddResidualBlock(
        new ceres::AutoDiffCostFunction<CellError, 1, 1, 2, 3>(
            new CellError{(cell.x - size.width / 2.0) / half_diagonal,
                          (cell.y - size.height / 2.0) / half_diagonal, light}),
        new ceres::CauchyLoss(kCauchyScale), &level, centre.data(), a.data()));
  }
  constexpr double kFarOff = 0.3;  // of half a diagonal: without vignetting any centre would fit
  for (int i = 0; i < 2; ++i) {
    problem.SetParameterLowerBound(centre.data(), i, -kFarOff);
    problem.SetParameterUpperBound(centre.data(), i, kFarOff);
  }
  ceres::Solver::Summary summary;
  ceres::Solve(ceres_options(ceres::DENSE_QR, 200), &problem, &summary);

  VignettingFit found;
  found.lens = {size.width / 2.0 + centre[0] * half_diagonal,
                size.height / 2.0 + centre[1] * half_diagonal, a};
  std::vector<double> errors;
  ceres::Problem::EvaluateOptions without_loss;
  without_loss.apply_loss_function = false;
  without_loss.residual_blocks = blocks;
  double cost = 0;
  problem.Evaluate(without_loss, &cost, &errors, nullptr, nullptr);
  double squares = 0;
  for (const double error : errors) squares += error * error;
  found.residual =
      std::sqrt(squares / static_cast<double>(std::max<std::size_t>(1, errors.size())));
  return found;
}

schemas::Rgb mean_centre_transmission(const schemas::PhotometricResponse& response,
                                      rig::PictureSize size) {
  schemas::Rgb left{};
  constexpr int kSteps = 32;
  for (int j = 0; j < kSteps; ++j) {
    for (int i = 0; i < kSteps; ++i) {
      const schemas::Rgb gain =
          rig::gain_at(response, size, size.width * (0.25 + 0.5 * (i + 0.5) / kSteps),
                       size.height * (0.25 + 0.5 * (j + 0.5) / kSteps));
      for (std::size_t c = 0; c < 3; ++c) left[c] += 1 / gain[c] / (kSteps * kSteps);
    }
  }
  return left;
}

}  // namespace raystage::calibrate
