// SPDX-License-Identifier: Apache-2.0
// Fits lines through (slot, time stamp) pairs of a group of cameras by Huber's M-estimator. Each
// camera's line and own phase steps are eliminated by the Schur complement; the group's common
// steps are solved first. One reweighting per call. Times in ns. Cost: O(frames + cameras steps^3).
#include "store/processing/sync/line_fit.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

namespace raystage::store {
namespace {

constexpr double kHuber = 2;        // sigmas; 99 % efficient where jitter is Gaussian
constexpr double kOutlier = 6;      // sigmas of its side (early or late)
constexpr double kMinJitter = 500;  // ns: rounding of time stamps to microseconds
constexpr double kTail = 1.6449;    // sigmas of the 95 % quantile
constexpr double kMinPeriod = 1e5;  // ns; frames of a flushed queue are closer, without a rate
constexpr double kMaxSlotsPerFrame = 20;

double weight_of(const ClockFit& fit, std::size_t i) {
  if (fit.is_outlier(i)) return 0;
  const double sigma = std::max(fit.jitter, kMinJitter);
  const double bound = kHuber * sigma;
  const double size = std::abs(fit.residual[i]);
  return (size <= bound ? 1 : bound / size) / (sigma * sigma);
}

// Normal equations of one camera. Unknowns: its line and own phase steps; the group's steps.
struct NormalEquations {
  Eigen::MatrixXd own, mixed, shared;
  Eigen::VectorXd own_right, shared_right;
};

NormalEquations normal_equations(const CameraLine& camera, double middle, int group_steps) {
  const ClockFit& fit = *camera.fit;
  const auto own_steps = std::ranges::count(fit.phase_steps, -1, &PhaseStep::group_step);
  const Eigen::Index own = 2 + own_steps;
  const Eigen::Index all = own + group_steps;
  Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(all, all);
  Eigen::VectorXd right = Eigen::VectorXd::Zero(all);
  // Between phase steps all rows are (1, slot, equal zeros and ones): five sums suffice.
  std::vector<double> row(static_cast<std::size_t>(all), 0);
  std::size_t frame = 0, next = 0;
  Eigen::Index next_own = 2;
  while (frame < fit.slots.size()) {
    for (; next < fit.phase_steps.size() && fit.phase_steps[next].first_frame <= frame; ++next) {
      const PhaseStep& b = fit.phase_steps[next];
      row[b.group_step < 0 ? next_own++ : own + b.group_step] = 1;
    }
    const std::size_t end = next < fit.phase_steps.size()
                                ? std::min(fit.phase_steps[next].first_frame, fit.slots.size())
                                : fit.slots.size();
    double w = 0, wx = 0, wxx = 0, wy = 0, wxy = 0;
    for (; frame < end; ++frame) {
      const double weight = weight_of(fit, frame);
      if (weight == 0) continue;
      const double x = static_cast<double>(fit.slots[frame]) - middle;
      // Relative to the current line, to avoid cancellation.
      const double y = camera.times[frame] - fit.lattice.at(fit.slots[frame]);
      w += weight;
      wx += weight * x;
      wxx += weight * x * x;
      wy += weight * y;
      wxy += weight * x * y;
    }
    normal(0, 0) += w;
    normal(0, 1) += wx;
    normal(1, 1) += wxx;
    right(0) += wy;
    right(1) += wxy;
    for (Eigen::Index i = 2; i < all; ++i) {
      if (row[i] == 0) continue;
      normal(0, i) += w;
      normal(1, i) += wx;
      right(i) += wy;
      for (Eigen::Index j = i; j < all; ++j) {
        if (row[j] != 0) normal(i, j) += w;
      }
    }
  }
  normal = normal.selfadjointView<Eigen::Upper>();
  // A step without frames on one side must not make the matrix singular.
  for (Eigen::Index i = 0; i < own; ++i) normal(i, i) = normal(i, i) * (1 + 1e-12) + 1e-30;
  return {normal.topLeftCorner(own, own), normal.topRightCorner(own, group_steps),
          normal.bottomRightCorner(group_steps, group_steps), right.head(own),
          right.tail(group_steps)};
}

double middle_slot(const ClockFit& fit) {
  double sum = 0, count = 0;
  for (const std::int64_t slot : fit.slots) {
    if (slot == kNoSlot) continue;
    sum += static_cast<double>(slot);
    count += 1;
  }
  return count > 0 ? std::round(sum / count) : 0;
}

}  // namespace

int group_step_count(std::span<const CameraLine> group) {
  int count = 0;
  for (const CameraLine& camera : group) {
    for (const PhaseStep& b : camera.fit->phase_steps) count = std::max(count, b.group_step + 1);
  }
  return count;
}

Lattice least_squares_line(std::span<const double> slots, std::span<const double> times) {
  double x = 0, y = 0;
  const auto count = static_cast<double>(slots.size());
  for (std::size_t i = 0; i < slots.size(); ++i) {
    x += slots[i] / count;
    y += times[i] / count;
  }
  double xx = 0, xy = 0;
  for (std::size_t i = 0; i < slots.size(); ++i) {
    xx += (slots[i] - x) * (slots[i] - x);
    xy += (slots[i] - x) * (times[i] - y);
  }
  const double period = xy / xx;
  return {y - period * x, period};
}

void update_residuals(const CameraLine& camera) {
  ClockFit& fit = *camera.fit;
  fit.residual.assign(fit.slots.size(), 0);
  std::vector<double> values;
  values.reserve(fit.slots.size());
  double shift = 0;
  std::size_t next = 0, counted = 0;
  for (std::size_t i = 0; i < fit.slots.size(); ++i) {
    for (; next < fit.phase_steps.size() && fit.phase_steps[next].first_frame <= i; ++next) {
      shift += fit.phase_steps[next].step;
    }
    if (fit.slots[i] == kNoSlot) continue;
    ++counted;
    fit.residual[i] = camera.times[i] - shift - fit.lattice.at(fit.slots[i]);
    values.push_back(fit.residual[i]);
  }
  const double low = quantile(values, 0.05), middle = quantile(values, 0.5),
               high = quantile(values, 0.95);
  fit.jitter = (quantile(values, 0.8413) - quantile(values, 0.1587)) / 2;
  const double least = std::max(fit.jitter / 2, kMinJitter);
  fit.early_limit = middle - kOutlier * std::max((middle - low) / kTail, least);
  fit.late_limit = middle + kOutlier * std::max((high - middle) / kTail, least);
  std::size_t outliers = 0;
  for (std::size_t i = 0; i < fit.slots.size(); ++i) outliers += fit.is_outlier(i) ? 1 : 0;
  fit.regular = counted >= 2 && 10 * outliers <= fit.slots.size() &&
                fit.jitter < fit.lattice.period / 5 && fit.lattice.period >= kMinPeriod &&
                fit.slots_spanned() <= kMaxSlotsPerFrame * static_cast<double>(counted);
}

void fit_least_squares(std::span<const CameraLine> group) {
  const int steps = group_step_count(group);
  std::vector<NormalEquations> equations;
  Eigen::MatrixXd shared = Eigen::MatrixXd::Identity(steps, steps) * 1e-30;
  Eigen::VectorXd right = Eigen::VectorXd::Zero(steps);
  std::vector<Eigen::LDLT<Eigen::MatrixXd>> solvers;
  for (const CameraLine& camera : group) {
    equations.push_back(normal_equations(camera, middle_slot(*camera.fit), steps));
    const NormalEquations& e = equations.back();
    solvers.emplace_back(e.own);
    if (steps == 0) continue;
    shared += e.shared - e.mixed.transpose() * solvers.back().solve(e.mixed);
    right += e.shared_right - e.mixed.transpose() * solvers.back().solve(e.own_right);
  }
  Eigen::VectorXd group_steps = Eigen::VectorXd::Zero(steps);
  if (steps > 0) group_steps = shared.ldlt().solve(right);
  for (std::size_t c = 0; c < group.size(); ++c) {
    ClockFit& fit = *group[c].fit;
    const NormalEquations& e = equations[c];
    const Eigen::VectorXd own = solvers[c].solve(e.own_right - e.mixed * group_steps);
    fit.lattice.origin += own(0) - own(1) * middle_slot(fit);
    fit.lattice.period += own(1);
    Eigen::Index next = 2;
    for (PhaseStep& b : fit.phase_steps) {
      b.step = b.group_step < 0 ? own(next++) : group_steps(b.group_step);
    }
    Eigen::VectorXd unit = Eigen::VectorXd::Zero(e.own.rows());
    unit(1) = 1;
    fit.period_sigma = std::sqrt(std::max(solvers[c].solve(unit)(1), 0.0));
  }
}

}  // namespace raystage::store
