// SPDX-License-Identifier: Apache-2.0
// Computes the covariance of a bundle adjustment as a free network (Triggs et al. 2000, section 9).
// Points or boards are eliminated from the normal equations, and the gauge directions of the world
// are projected out. The result is scaled by tolerances and inverted by an eigendecomposition. The
// noise is estimated from the residuals and enlarged for their correlation. Output: one standard
// deviation per parameter. Cost: observations per point squared, plus parameters cubed.
#include "calibrate/geometry/uncertainty.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "calibrate/geometry/median.h"
#include "calibrate/geometry/observation_jacobian.h"
#include "calibrate/geometry/parameter_layout.h"

namespace raystage::calibrate {
namespace {

using Eigen::Index;
using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

constexpr double kUnknown = 1e6;  // tolerances: deviation of undetermined directions

/// Groups observations by point, or by body.
std::vector<std::vector<const ArrayModel::Observation*>> groups_of(const ArrayModel& model) {
  std::vector<std::size_t> group_of(model.points.size());
  for (std::size_t i = 0; i < group_of.size(); ++i) group_of[i] = i;
  for (std::size_t b = 0; b < model.bodies.size(); ++b) {
    for (const int point : model.bodies[b].points) group_of[point] = b;
  }
  std::vector<std::vector<const ArrayModel::Observation*>> groups(model.points.size());
  for (const ArrayModel::Observation& o : model.observations) {
    if (model.counts(o)) groups[group_of[o.point]].push_back(&o);
  }
  return groups;
}

ReducedNormalEquations information_of(const ArrayModel& model, const ParameterLayout& layout) {
  const CameraModels lenses = camera_models(model);
  const bool has_bodies = !model.bodies.empty();
  const Index freedom = has_bodies ? 6 : 3;
  ReducedNormalEquations sum(layout.size);
  const auto groups = groups_of(model);
  for (std::size_t g = 0; g < groups.size(); ++g) {
    std::vector<ObservationRows> rows;
    std::vector<Eigen::Vector2d> residuals;
    MatrixXd by_common(2 * static_cast<Index>(groups[g].size()), freedom);
    for (const ArrayModel::Observation* o : groups[g]) {
      const auto residual = reprojection_residual(model, lenses, *o);
      if (!residual) continue;
      rows.push_back(observation_rows(model, *o, layout));
      residuals.push_back(*residual);
      const Index at = 2 * (static_cast<Index>(rows.size()) - 1);
      by_common.block<2, 3>(at, 0) = rows.back().by_point;
      if (freedom == 6) {
        const Vector3d from_middle = *model.points[o->point] - model.bodies[g].pose->position;
        by_common.block<2, 3>(at, 3) = -rows.back().by_point * cross_matrix(from_middle);
      }
    }
    if (rows.empty()) continue;
    by_common.conservativeResize(2 * static_cast<Index>(rows.size()), freedom);
    sum.add(rows, by_common, residuals);
  }
  return sum;
}

/// Returns the motions of poses by translation (3), rotation (3) and scale (1) of the world:
/// columns over all parameters.
MatrixXd world_motions(const ArrayModel& model, const ParameterLayout& layout) {
  MatrixXd motions = MatrixXd::Zero(layout.size, 7);
  for (std::size_t i = 0; i < model.cameras.size(); ++i) {
    const Index at = layout.pose[i];
    if (at == kFixed) continue;
    const rig::Pose& pose = *model.cameras[i].pose;
    motions.block<3, 3>(at + 3, 0) = Matrix3d::Identity();
    motions.block<3, 3>(at, 3) = -pose.world_from_camera_rotation.transpose();
    motions.block<3, 3>(at + 3, 3) = -cross_matrix(pose.position);
    motions.block<3, 1>(at + 3, 6) = pose.position;
  }
  return motions;
}

/// Returns the motions of the world that held cameras leave free: none with two of them; the scale
/// with one.
MatrixXd free_motions(const ArrayModel& model, const ParameterLayout& layout) {
  MatrixXd motions = world_motions(model, layout);
  std::vector<Vector3d> rest;
  for (std::size_t i = 0; i < model.cameras.size(); ++i) {
    const bool is_in_use = layout.lens[i] != kFixed || layout.pose[i] != kFixed;
    if (model.cameras[i].pose && layout.pose[i] == kFixed && is_in_use) {
      rest.push_back(model.cameras[i].pose->position);
    }
  }
  if (rest.empty()) return model.bodies.empty() ? motions : MatrixXd(motions.leftCols<6>());
  if (rest.size() > 1 || !model.bodies.empty()) return MatrixXd::Zero(layout.size, 0);
  const VectorXd growth = motions.col(6) - motions.leftCols<3>() * rest.front();
  return growth;
}

/// Returns the correlation of successive residuals of a camera, in the order of the points'
/// numbers; at least 0.
double residual_correlation(const ArrayModel& model) {
  const CameraModels lenses = camera_models(model);
  std::vector<std::optional<Eigen::Vector2d>> before(model.cameras.size());
  double together = 0, alone = 0;
  for (const ArrayModel::Observation& o : model.observations) {
    if (!model.counts(o)) continue;
    const auto residual = reprojection_residual(model, lenses, o);
    if (!residual) continue;
    auto& last = before[o.camera];
    if (last) {
      together += residual->dot(*last);
      alone += (residual->squaredNorm() + last->squaredNorm()) / 2;
    }
    last = residual;
  }
  constexpr double kMax = 0.95;
  return alone > 0 ? std::clamp(together / alone, 0.0, kMax) : 0;
}

}  // namespace

double median_neighbour_distance(const ArrayModel& model) {
  std::vector<double> nearest;
  for (std::size_t i = 0; i < model.cameras.size(); ++i) {
    double least = std::numeric_limits<double>::infinity();
    for (std::size_t j = 0; j < model.cameras.size(); ++j) {
      if (i == j || !model.cameras[i].pose || !model.cameras[j].pose) continue;
      least = std::min(least,
                       (model.cameras[i].pose->position - model.cameras[j].pose->position).norm());
    }
    if (std::isfinite(least)) nearest.push_back(least);
  }
  return nearest.empty() ? 0 : median(std::move(nearest));
}

std::optional<Uncertainty> estimate_uncertainty(const ArrayModel& model,
                                                const BundleAdjustmentOptions& free,
                                                const Tolerances& tolerances, double min_noise_px) {
  const ParameterLayout layout = make_parameter_layout(model, free);
  if (layout.size == 0) return std::nullopt;
  const ReducedNormalEquations information = information_of(model, layout);
  if (information.observations == 0) return std::nullopt;
  const MatrixXd motions = free_motions(model, layout);
  const double surplus = 2.0 * information.observations - information.eliminated -
                         static_cast<double>(layout.size - motions.cols());
  Uncertainty result;
  result.noise_px =
      std::max(std::sqrt(information.squared_error / std::max(surplus, 1.0)), min_noise_px);

  // In tolerances, with the world's motions made as certain as the most certain direction.
  const VectorXd one = parameter_tolerances(model, layout, tolerances);
  MatrixXd scaled = one.asDiagonal() * information.matrix * one.asDiagonal();
  scaled = (scaled + scaled.transpose()).eval() / 2;
  MatrixXd world(layout.size, 0);
  if (motions.cols() > 0) {
    const MatrixXd in_tolerances = one.cwiseInverse().asDiagonal() * motions;
    Eigen::JacobiSVD<MatrixXd> svd(in_tolerances, Eigen::ComputeThinU);
    world = svd.matrixU().leftCols(svd.rank());
  }
  const double most = std::max(scaled.diagonal().maxCoeff(), 1e-300);
  scaled += most * world * world.transpose();
  const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(scaled);
  const double least = std::numeric_limits<double>::epsilon() * static_cast<double>(layout.size) *
                       std::max(eigen.eigenvalues().maxCoeff(), 1e-300);
  result.correlation = residual_correlation(model);
  // Effective number of independent residuals (first-order autoregression).
  const double variance =
      result.noise_px * result.noise_px * (1 + result.correlation) / (1 - result.correlation);
  MatrixXd covariance = MatrixXd::Zero(layout.size, layout.size);
  for (Index k = 0; k < layout.size; ++k) {
    // Directions below rounding errors are undetermined, however small the noise is.
    const double value = eigen.eigenvalues()[k] > least
                             ? eigen.eigenvalues()[k]
                             : std::min(least, variance / (kUnknown * kUnknown));
    const VectorXd direction = eigen.eigenvectors().col(k);
    const double of_world = world.cols() > 0 ? (world.transpose() * direction).squaredNorm() : 0;
    if (of_world > 0.5) continue;
    covariance += (variance / value) * direction * direction.transpose();
    // By the largest effect in it: an array of many cameras is not less certain than one of few.
    const double deviation = 2 * std::sqrt(variance / value) * max_effect(direction, layout);
    if (k == 0 || deviation > 1) {
      result.weakest.push_back(summarise_direction(direction, deviation, layout));
    }
  }
  const VectorXd deviations = covariance.diagonal().cwiseMax(0).cwiseSqrt().cwiseProduct(one);
  for (std::size_t i = 0; i < model.cameras.size(); ++i) {
    if (layout.pose[i] == kFixed && layout.lens[i] == kFixed) {
      result.cameras.emplace_back();
      continue;
    }
    Uncertainty::Camera camera;
    if (layout.pose[i] != kFixed) {
      camera.rotation_deg = deviations.segment<3>(layout.pose[i]) * 180 / std::numbers::pi;
      camera.position = deviations.segment<3>(layout.pose[i] + 3);
    }
    const std::vector<int>& free_in_lens = layout.free_lens_parameters[i];
    for (std::size_t k = 0; layout.lens[i] != kFixed && k < free_in_lens.size(); ++k) {
      camera.lens[free_in_lens[k]] = deviations[layout.lens[i] + static_cast<Index>(k)];
    }
    if (layout.lens[i] != kFixed && layout.square_pixels) camera.lens[1] = camera.lens[0];
    result.cameras.emplace_back(camera);
  }
  std::ranges::stable_sort(result.weakest, std::greater<>(), &Uncertainty::Direction::deviation);
  return result;
}

}  // namespace raystage::calibrate
