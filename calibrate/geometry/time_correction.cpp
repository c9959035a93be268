// SPDX-License-Identifier: Apache-2.0
// Estimates clock offsets and line times of cameras from a moving light: one Gauss-Newton step of a
// bundle adjustment that has them as parameters. A camera whose times are ahead by d and whose rows
// are exposed at L (y - c) after the time stamp sees a light of velocity v displaced by
// v (L (y - c) - d). In an array of parallel cameras most of that is a displacement of the point
// along its path, so that a line time shows by the parallax along the columns; therefore poses,
// lenses and points are free in the same step. The step is linear: callers correct the times, solve
// again and repeat. Input: residuals in pixels, velocities in pixels per second. Cost: observations
// per point squared, plus parameters cubed.
#include "calibrate/geometry/time_correction.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "calibrate/geometry/observation_jacobian.h"
#include "rig/row_times.h"

namespace raystage::calibrate {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::VectorXd;

constexpr int kMinObservations = 20;  // of a camera
constexpr double kUsPerSecond = 1e6;

/// Indices of the parameters of time among all parameters.
struct TimeLayout {
  ParameterLayout of_model;
  std::vector<Index> clock, line;  // by camera; kFixed: held
  Index size = 0;
};

std::vector<int> usable_observations(const ArrayModel& model,
                                     const std::vector<std::optional<Vector2d>>& velocities) {
  std::vector<int> count(model.cameras.size(), 0);
  for (std::size_t i = 0; i < model.observations.size(); ++i) {
    const ArrayModel::Observation& o = model.observations[i];
    if (model.counts(o) && velocities[i]) ++count[o.camera];
  }
  return count;
}

TimeLayout time_layout(const ArrayModel& model, const BundleAdjustmentOptions& free,
                       const std::vector<int>& observations, const TimeCorrectionOptions& options) {
  TimeLayout layout;
  layout.of_model = make_parameter_layout(model, free);
  layout.size = layout.of_model.size;
  for (std::size_t c = 0; c < model.cameras.size(); ++c) {
    const bool is_enough = observations[c] >= kMinObservations;
    layout.clock.push_back(is_enough && options.estimates_clocks ? layout.size++ : kFixed);
    layout.line.push_back(is_enough && options.estimates_line_time[c] ? layout.size++ : kFixed);
  }
  return layout;
}

/// Adds the derivatives by clock offset (seconds) and line time (seconds) of an observation.
void add_time(const ArrayModel::Observation& o, const Vector2d& velocity, int height,
              const TimeLayout& layout, ObservationRows& rows) {
  const auto add = [&](Index unknown, const Vector2d& derivative) {
    if (unknown == kFixed) return;
    rows.unknowns.push_back(unknown);
    rows.by_unknowns.conservativeResize(2, rows.by_unknowns.cols() + 1);
    rows.by_unknowns.rightCols<1>() = derivative;
  };
  add(layout.clock[o.camera], -velocity);
  add(layout.line[o.camera], rig::row_time(1, height, o.pixel.y()) * velocity);
}

/// The observations of one point that are used, with their derivatives.
struct PointObservations {
  std::vector<ObservationRows> rows;
  std::vector<Vector2d> residuals;
  std::vector<int> cameras;

  MatrixXd by_point() const {
    MatrixXd all(2 * static_cast<Index>(rows.size()), 3);
    for (std::size_t k = 0; k < rows.size(); ++k) {
      all.middleRows<2>(2 * static_cast<Index>(k)) = rows[k].by_point;
    }
    return all;
  }
};

/// Calls `visit` for each point with at least two observations that are used, in their order.
template <class Visit>
void for_points(const ArrayModel& model, const std::vector<std::optional<Vector2d>>& velocities,
                const TimeLayout& layout, const Visit& visit) {
  const CameraModels lenses = camera_models(model);
  PointObservations point;
  int number = -1;
  const auto finish = [&] {
    if (point.rows.size() > 1) visit(point);
    point = {};
  };
  for (std::size_t i = 0; i < model.observations.size(); ++i) {
    const ArrayModel::Observation& o = model.observations[i];
    if (o.point != number) finish();
    number = o.point;
    if (!model.counts(o) || !velocities[i]) continue;
    const auto residual = reprojection_residual(model, lenses, o);
    if (!residual) continue;
    point.rows.push_back(observation_rows(model, o, layout.of_model));
    point.residuals.push_back(*residual);
    point.cameras.push_back(o.camera);
    add_time(o, *velocities[i], model.cameras[o.camera].height, layout, point.rows.back());
  }
  finish();
}

/// What the step leaves of the residuals.
struct Remainder {
  double squared_error = 0;  // pixels squared
  double correlation = 0;    // of successive residuals of a camera, 0 to 0.95
};

Remainder remainder_after(const ArrayModel& model,
                          const std::vector<std::optional<Vector2d>>& velocities,
                          const TimeLayout& layout, const VectorXd& step) {
  Remainder remainder;
  std::vector<std::optional<Vector2d>> last(model.cameras.size());
  double together = 0, alone = 0;
  for_points(model, velocities, layout, [&](const PointObservations& point) {
    VectorXd off(2 * static_cast<Index>(point.rows.size()));
    for (std::size_t k = 0; k < point.rows.size(); ++k) {
      Vector2d of_observation = point.residuals[k];
      for (std::size_t u = 0; u < point.rows[k].unknowns.size(); ++u) {
        of_observation -=
            point.rows[k].by_unknowns.col(static_cast<Index>(u)) * step[point.rows[k].unknowns[u]];
      }
      off.segment<2>(2 * static_cast<Index>(k)) = of_observation;
    }
    const MatrixXd by_point = point.by_point();
    const VectorXd shift = by_point.colPivHouseholderQr().solve(off);
    off -= by_point * shift;
    remainder.squared_error += off.squaredNorm();
    for (std::size_t k = 0; k < point.rows.size(); ++k) {
      const Vector2d now = off.segment<2>(2 * static_cast<Index>(k));
      auto& before = last[point.cameras[k]];
      if (before) {
        together += now.dot(*before);
        alone += (now.squaredNorm() + before->squaredNorm()) / 2;
      }
      before = now;
    }
  });
  constexpr double kMax = 0.95;
  if (alone > 0) remainder.correlation = std::clamp(together / alone, 0.0, kMax);
  return remainder;
}

}  // namespace

std::optional<TimeCorrection> estimate_time_correction(
    const ArrayModel& model, const BundleAdjustmentOptions& free,
    const std::vector<std::optional<Vector2d>>& velocities, const TimeCorrectionOptions& options) {
  const std::size_t cameras = model.cameras.size();
  const TimeLayout layout =
      time_layout(model, free, usable_observations(model, velocities), options);
  TimeCorrection found;
  found.clock_s.assign(cameras, 0);
  found.line_time_us.assign(cameras, 0);
  for (std::size_t c = 0; c < cameras; ++c) {
    if (layout.line[c] != kFixed) found.line_cameras.push_back(static_cast<int>(c));
  }
  if (found.line_cameras.size() < 2) return std::nullopt;
  ReducedNormalEquations equations(layout.size);
  for_points(model, velocities, layout, [&](const PointObservations& point) {
    equations.add(point.rows, point.by_point(), point.residuals);
  });
  const double surplus =
      2.0 * equations.observations - equations.eliminated - static_cast<double>(layout.size);
  if (!(surplus > 0)) return std::nullopt;

  // Scaled to a unit diagonal. The world's motions and a common clock offset are undetermined and
  // change no line time; the small ridge gives them a value.
  constexpr double kRidge = 1e-10;
  VectorXd scale = equations.matrix.diagonal();
  for (Index k = 0; k < scale.size(); ++k) scale[k] = scale[k] > 0 ? 1 / std::sqrt(scale[k]) : 1;
  MatrixXd scaled = scale.asDiagonal() * equations.matrix * scale.asDiagonal();
  scaled = ((scaled + scaled.transpose()) / 2).eval();
  scaled.diagonal().array() += kRidge;
  const Eigen::LDLT<MatrixXd> solver(scaled);
  const VectorXd step = scale.asDiagonal() * solver.solve(scale.asDiagonal() * equations.right);
  if (!step.allFinite()) return std::nullopt;

  const auto lines = static_cast<Index>(found.line_cameras.size());
  MatrixXd of_lines = MatrixXd::Zero(layout.size, lines);
  for (Index k = 0; k < lines; ++k) {
    const Index at = layout.line[found.line_cameras[static_cast<std::size_t>(k)]];
    of_lines(at, k) = scale[at];
  }
  // Of what the step leaves: before it, residuals have the effect of the line times.
  const Remainder remainder = remainder_after(model, velocities, layout, step);
  found.noise_px = std::sqrt(remainder.squared_error / surplus);
  const double variance =
      found.noise_px * found.noise_px * (1 + remainder.correlation) / (1 - remainder.correlation);
  found.line_covariance =
      kUsPerSecond * kUsPerSecond * variance * of_lines.transpose() * solver.solve(of_lines);
  double mean = 0;
  int clocks = 0;
  for (std::size_t c = 0; c < cameras; ++c) {
    if (layout.line[c] != kFixed) found.line_time_us[c] = kUsPerSecond * step[layout.line[c]];
    if (layout.clock[c] == kFixed) continue;
    found.clock_s[c] = step[layout.clock[c]];
    mean += found.clock_s[c];
    ++clocks;
  }
  for (std::size_t c = 0; c < cameras; ++c) {
    if (layout.clock[c] != kFixed) found.clock_s[c] -= mean / clocks;
  }
  return found;
}

}  // namespace raystage::calibrate
