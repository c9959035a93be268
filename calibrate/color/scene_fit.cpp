// SPDX-License-Identifier: Apache-2.0
// Joint least squares over contrast and brightness of the cameras and the linear light of common
// points (Ceres, Cauchy's loss, Schur complement over points). Measured codes: linear light, full
// scale 1. The reference camera is held. uncertainty() inverts the reduced camera system with
// points eliminated. Cost: observations per iteration; cameras cubed for the uncertainty.
#include "calibrate/color/scene_fit.h"

#include <ceres/ceres.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <memory>

#include "base/error.h"
#include "calibrate/geometry/ceres_options.h"

namespace raystage::calibrate {
namespace {

/// Residual: predicted minus measured light of a point in a camera, in standard deviations.
struct ObservationError {
  schemas::Rgb measured, gain, deviation;
  schemas::ColorMatrix unmix;

  template <typename T>
  bool operator()(const T* camera, const T* light, T* error) const {
    for (std::size_t c = 0; c < 3; ++c) {
      const T unmixed = unmix[c][0] * light[0] + unmix[c][1] * light[1] + unmix[c][2] * light[2];
      error[c] = ((unmixed / gain[c] - camera[3 + c]) * camera[c] - measured[c]) / deviation[c];
    }
    return true;
  }
};
using ObservationCost = ceres::AutoDiffCostFunction<ObservationError, 3, 6, 3>;

/// Weak prior on a small brightness: a scene of uniform light cannot separate brightness and
/// contrast.
struct SmallBrightness {
  template <typename T>
  bool operator()(const T* camera, T* error) const {
    constexpr double kUsual = 0.05;
    for (int c = 0; c < 3; ++c) error[c] = camera[3 + c] / kUsual;
    return true;
  }
};

/// Derivatives of an observation's error by camera and light, weighted as in the solver.
struct Rows {
  Eigen::Matrix<double, 3, 6, Eigen::RowMajor> by_camera;
  Eigen::Matrix<double, 3, 3, Eigen::RowMajor> by_light;
  Eigen::Vector3d error;
};

Rows rows_of(const ObservationCost& cost, const SceneFit::CameraParameters& camera,
             const schemas::Rgb& light, double scale) {
  Rows rows;
  const double* const values[] = {camera.data(), light.data()};
  double* jacobians[] = {rows.by_camera.data(), rows.by_light.data()};
  cost.Evaluate(values, rows.error.data(), jacobians);
  const double root = std::sqrt(1 / (1 + rows.error.squaredNorm() / (scale * scale)));  // Cauchy's
  rows.by_camera *= root;
  rows.by_light *= root;
  rows.error *= root;
  return rows;
}

/// Returns two standard deviations of a camera's light, relative, the maximum over channels and
/// test levels.
double worst_light(const SceneFit::CameraParameters& camera,
                   const Eigen::Matrix<double, 6, 6>& covariance) {
  double worst = 0;
  for (int c = 0; c < 3; ++c) {
    for (const double light : {0.1, 0.5}) {
      const double inverse_contrast = camera[c];
      const double measured = (light - camera[3 + c]) * inverse_contrast;
      Eigen::Matrix<double, 6, 1> slope = Eigen::Matrix<double, 6, 1>::Zero();
      slope[c] = -measured / (inverse_contrast * inverse_contrast);
      slope[3 + c] = 1;
      const double variance = slope.dot(covariance * slope);
      worst = std::max(worst, 2 * std::sqrt(std::max(0.0, variance)) / light);
    }
  }
  return worst;
}

}  // namespace

SceneFit::SceneFit(std::span<const ScenePatch> points, const rig::Rig& rig, std::size_t reference)
    : rig_(rig), reference_(reference) {
  for (std::size_t p = 0; p < points.size(); ++p) {
    for (const ScenePatch::Observation& seen : points[p].observations) {
      const auto camera = static_cast<std::size_t>(seen.camera);
      const rig::Rig::Camera& of = rig.cameras[camera];
      const rig::PictureSize size{of.model.width(), of.model.height()};
      Observation observation{
          p, camera, seen.measured, rig::gain_at(of.photometric, size, seen.x, seen.y), {}, true};
      // Quantisation in the dark; surfaces whose light depends on the direction.
      constexpr double kNoiseFloor = 0.002, kRelativeNoise = 0.01;
      for (std::size_t c = 0; c < 3; ++c) {
        observation.deviation[c] = kNoiseFloor + kRelativeNoise * seen.measured[c];
      }
      observations_.push_back(observation);
    }
  }
  for (const rig::Rig::Camera& camera : rig.cameras) {
    const schemas::PhotometricResponse& r = camera.photometric;
    unmix_.push_back(rig::inverse(r.matrix));
    cameras_.push_back({1 / r.contrast[0], 1 / r.contrast[1], 1 / r.contrast[2], r.brightness[0],
                        r.brightness[1], r.brightness[2]});
  }
  start_ = cameras_;
  light_.resize(points.size());
  light_ = mean_lights();
}

schemas::Rgb SceneFit::estimated_light(const Observation& observation,
                                       const CameraParameters& camera) const {
  schemas::Rgb light{};
  for (std::size_t c = 0; c < 3; ++c) {
    light[c] = observation.gain[c] * (camera[3 + c] + observation.measured[c] / camera[c]);
  }
  return rig::multiply(rig_.cameras[observation.camera].photometric.matrix, light);
}

std::vector<schemas::Rgb> SceneFit::mean_lights() const {
  std::vector<schemas::Rgb> lights(light_.size(), schemas::Rgb{});
  std::vector<int> counts(light_.size(), 0);
  for (const Observation& observation : observations_) {
    const schemas::Rgb light = estimated_light(observation, cameras_[observation.camera]);
    for (std::size_t c = 0; c < 3; ++c) lights[observation.point][c] += light[c];
    ++counts[observation.point];
  }
  for (std::size_t p = 0; p < lights.size(); ++p) {
    for (double& channel : lights[p]) channel /= std::max(1, counts[p]);
  }
  return lights;
}

double SceneFit::normalised_residual(const Observation& observation) const {
  const ObservationError error{observation.measured, observation.gain, observation.deviation,
                               unmix_[observation.camera]};
  std::array<double, 3> off{};
  error(cameras_[observation.camera].data(), light_[observation.point].data(), off.data());
  return std::max({std::abs(off[0]), std::abs(off[1]), std::abs(off[2])});
}

void SceneFit::solve(double scale, const std::function<bool(std::size_t)>& counts,
                     const std::stop_token& stop) {
  ceres::Problem problem;
  auto ordering = std::make_shared<ceres::ParameterBlockOrdering>();
  for (const Observation& observation : observations_) {
    if (!observation.counts || !counts(observation.point)) continue;
    problem.AddResidualBlock(new ObservationCost(new ObservationError{
                                 observation.measured, observation.gain, observation.deviation,
                                 unmix_[observation.camera]}),
                             new ceres::CauchyLoss(scale), cameras_[observation.camera].data(),
                             light_[observation.point].data());
    ordering->AddElementToGroup(light_[observation.point].data(), 0);
  }
  if (problem.NumResidualBlocks() == 0) return;
  for (std::size_t c = 0; c < cameras_.size(); ++c) {
    problem.AddResidualBlock(
        new ceres::AutoDiffCostFunction<SmallBrightness, 3, 6>(new SmallBrightness), nullptr,
        cameras_[c].data());
    ordering->AddElementToGroup(cameras_[c].data(), 1);
    constexpr double kMin = 0.01, kMax = 100;  // of contrast
    for (int k = 0; k < 3; ++k) {
      problem.SetParameterLowerBound(cameras_[c].data(), k, 1 / kMax);
      problem.SetParameterUpperBound(cameras_[c].data(), k, 1 / kMin);
    }
  }
  problem.SetParameterBlockConstant(cameras_[reference_].data());
  ceres::Solver::Options options = ceres_options(ceres::DENSE_SCHUR, 60);
  options.linear_solver_ordering = ordering;
  CeresStopCallback stops(stop);
  options.callbacks.push_back(&stops);
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);  // if it fails, the uncertainty is large
  if (stop.stop_requested()) {
    throw Error::failed("the matching of colours was stopped", "", "Start it again");
  }
}

std::vector<double> SceneFit::uncertainty(double scale) const {
  using Eigen::Index;
  const auto first = [](std::size_t camera) { return 6 * static_cast<Index>(camera); };
  const Index size = first(cameras_.size());
  Eigen::MatrixXd information = Eigen::MatrixXd::Zero(size, size);
  std::vector<std::vector<const Observation*>> of_point(light_.size());
  for (const Observation& observation : observations_) {
    if (observation.counts) of_point[observation.point].push_back(&observation);
  }
  double squares = 0, surplus = -static_cast<double>(size - 6);
  for (std::size_t p = 0; p < of_point.size(); ++p) {
    if (of_point[p].size() < 2) continue;
    Eigen::Matrix3d of_light = Eigen::Matrix3d::Zero();
    std::vector<Eigen::Matrix<double, 6, 3>> across;
    for (const Observation* const observation : of_point[p]) {
      const ObservationCost cost(new ObservationError{observation->measured, observation->gain,
                                                      observation->deviation,
                                                      unmix_[observation->camera]});
      const Rows rows = rows_of(cost, cameras_[observation->camera], light_[p], scale);
      const Index at = first(observation->camera);
      information.block<6, 6>(at, at) += rows.by_camera.transpose() * rows.by_camera;
      of_light += rows.by_light.transpose() * rows.by_light;
      across.emplace_back(rows.by_camera.transpose() * rows.by_light);
      squares += rows.error.squaredNorm();
    }
    surplus += 3.0 * (of_point[p].size() - 1);
    const Eigen::Matrix3d inverse_of_light = of_light.inverse();
    for (std::size_t a = 0; a < across.size(); ++a) {
      for (std::size_t b = 0; b < across.size(); ++b) {
        information.block<6, 6>(first(of_point[p][a]->camera), first(of_point[p][b]->camera)) -=
            across[a] * inverse_of_light * across[b].transpose();
      }
    }
  }
  // The reference camera is known.
  information.middleRows<6>(first(reference_)).setZero();
  information.middleCols<6>(first(reference_)).setZero();
  information.block<6, 6>(first(reference_), first(reference_)).setIdentity();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(
      (information + information.transpose()) / 2);
  constexpr double kUnknown = 100;  // deviation of undetermined parameters
  const double noise = squares / std::max(1.0, surplus);
  // below rounding errors
  const double least = 1e-12 * std::max(1.0, eigen.eigenvalues().maxCoeff());
  Eigen::VectorXd variances(size);
  for (Index k = 0; k < size; ++k) {
    const double value = eigen.eigenvalues()[k];
    variances[k] = value > least ? noise / value : kUnknown * kUnknown;
  }
  std::vector<double> worst;
  for (std::size_t c = 0; c < cameras_.size(); ++c) {
    const auto of_camera = eigen.eigenvectors().middleRows<6>(first(c));
    worst.push_back(c == reference_ ? 0
                                    : worst_light(cameras_[c], of_camera * variances.asDiagonal() *
                                                                   of_camera.transpose()));
  }
  return worst;
}

}  // namespace raystage::calibrate
