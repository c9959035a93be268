// SPDX-License-Identifier: Apache-2.0
#include "store/sync/line_fit.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

namespace raystage {
namespace {

constexpr double kHuber = 2;          // sigmas; 99 % efficient where jitter is Gaussian
constexpr double kOutlier = 6;        // sigmas of the side it lies on
constexpr double kLeastJitter = 500;  // ns: what stamps in whole microseconds scatter
constexpr double kTail = 1.6449;      // sigmas of the 95 % quantile

int group_steps_of(std::span<const CameraLine> group) {
  int count = 0;
  for (const CameraLine& camera : group) {
    for (const PhaseBreak& b : camera.fit->breaks) count = std::max(count, b.group_step + 1);
  }
  return count;
}

double weight_of(const ClockFit& fit, std::size_t i) {
  if (fit.is_outlier(i)) return 0;
  const double sigma = std::max(fit.jitter, kLeastJitter);
  const double bound = kHuber * sigma;
  const double size = std::abs(fit.residual[i]);
  return (size <= bound ? 1 : bound / size) / (sigma * sigma);
}

// Normal equations of one camera: its line and own breaks (own), the group's steps (shared).
struct NormalEquations {
  Eigen::MatrixXd own, mixed, shared;
  Eigen::VectorXd own_right, shared_right;
};

NormalEquations normal_equations(const CameraLine& camera, double middle, int group_steps) {
  const ClockFit& fit = *camera.fit;
  const auto own_breaks = std::ranges::count(fit.breaks, -1, &PhaseBreak::group_step);
  const Eigen::Index own = 2 + own_breaks;
  const Eigen::Index all = own + group_steps;
  Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(all, all);
  Eigen::VectorXd right = Eigen::VectorXd::Zero(all);
  // Between breaks every row is (1, slot, the same zeros and ones): five sums make a segment.
  std::vector<double> row(static_cast<std::size_t>(all), 0);
  std::size_t frame = 0, next = 0;
  Eigen::Index next_own = 2;
  while (frame < fit.slots.size()) {
    for (; next < fit.breaks.size() && fit.breaks[next].first_frame <= frame; ++next) {
      const PhaseBreak& b = fit.breaks[next];
      row[static_cast<std::size_t>(b.group_step < 0 ? next_own++ : own + b.group_step)] = 1;
    }
    const std::size_t end = next < fit.breaks.size()
                                ? std::min(fit.breaks[next].first_frame, fit.slots.size())
                                : fit.slots.size();
    double w = 0, wx = 0, wxx = 0, wy = 0, wxy = 0;
    for (; frame < end; ++frame) {
      const double weight = weight_of(fit, frame);
      if (weight == 0) continue;
      const double x = static_cast<double>(fit.slots[frame]) - middle;
      // About the line as it is: small numbers.
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
      if (row[static_cast<std::size_t>(i)] == 0) continue;
      normal(0, i) += w;
      normal(1, i) += wx;
      right(i) += wy;
      for (Eigen::Index j = i; j < all; ++j) {
        if (row[static_cast<std::size_t>(j)] != 0) normal(i, j) += w;
      }
    }
  }
  normal = normal.selfadjointView<Eigen::Upper>();
  // A break without frames on one side must not make the matrix singular.
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

// Frames that count, without their breaks.
struct Points {
  std::vector<double> slots, times;
  std::vector<std::size_t> frames;
};

Points points_of(const CameraLine& camera) {
  const ClockFit& fit = *camera.fit;
  Points points;
  points.slots.reserve(fit.slots.size());
  points.times.reserve(fit.slots.size());
  points.frames.reserve(fit.slots.size());
  double shift = 0;
  std::size_t next = 0;
  const double edge = lower_edge(fit);
  for (std::size_t i = 0; i < fit.slots.size(); ++i) {
    for (; next < fit.breaks.size() && fit.breaks[next].first_frame <= i; ++next) {
      shift += fit.breaks[next].step;
    }
    if (fit.slots[i] == kNoSlot || fit.residual[i] < edge) continue;
    points.slots.push_back(static_cast<double>(fit.slots[i]));
    points.times.push_back(camera.times[i] - shift);
    points.frames.push_back(i);
  }
  return points;
}

// Least of a convex function in [low, high].
template <typename Function>
double golden_section(double low, double high, const Function& function) {
  constexpr double kGolden = 0.6180339887498949;
  double a = high - kGolden * (high - low), b = low + kGolden * (high - low);
  double at_a = function(a), at_b = function(b);
  while (high - low > 1000) {  // ns
    if (at_a <= at_b) {
      high = b;
      b = a;
      at_b = at_a;
      a = high - kGolden * (high - low);
      at_a = function(a);
    } else {
      low = a;
      a = b;
      at_a = at_b;
      b = low + kGolden * (high - low);
      at_b = function(b);
    }
  }
  return (low + high) / 2;
}

// How far the steps of breaks[index_of[c]] of the cameras must move together for their envelopes to
// fit best.
double step_correction(std::span<const CameraLine> cameras, std::span<const std::size_t> index_of) {
  std::vector<Points> points;
  double jitter = 0;
  for (const CameraLine& camera : cameras) {
    points.push_back(points_of(camera));
    jitter = std::max(jitter, camera.fit->jitter);
  }
  std::vector<double> moved;
  const auto misfit = [&](double delta) {  // minus the log likelihood
    double sum = 0;
    for (std::size_t c = 0; c < cameras.size(); ++c) {
      const std::size_t first = cameras[c].fit->breaks[index_of[c]].first_frame;
      moved = points[c].times;
      for (std::size_t i = 0; i < moved.size(); ++i) {
        if (points[c].frames[i] >= first) moved[i] -= delta;
      }
      sum += lower_envelope(points[c].slots, moved, false).sum;
    }
    return sum;
  };
  const double best = golden_section(-jitter, jitter, misfit);
  if (jitter == 0) return best;

  // As for the line, the mean over what is likely beats the most likely. For exponential delays the
  // jitter as it is measured is 0.83 of the mean delay.
  constexpr double kMeanDelay = 1.2, kUnlikely = 8;
  const double scale = kMeanDelay * jitter, least = misfit(best);
  double reach = jitter / 256;
  while (reach < jitter &&
         std::min(misfit(best - reach), misfit(best + reach)) - least < kUnlikely * scale) {
    reach *= 2;
  }
  constexpr int kSamples = 32;
  double weight = 0, mean = 0;
  for (int k = -kSamples; k <= kSamples; ++k) {
    const double delta = best + reach * k / kSamples;
    const double w = std::exp(-(misfit(delta) - least) / scale);
    weight += w;
    mean += w * delta;
  }
  return mean / weight;
}

}  // namespace

double lower_edge(const ClockFit& fit) {
  constexpr std::size_t kMost = 3, kNext = 20;
  constexpr double kGap = 15;  // one in three million where delays are exponential
  std::vector<double> values;
  for (std::size_t i = 0; i < fit.slots.size(); ++i) {
    if (fit.slots[i] != kNoSlot && fit.residual[i] >= fit.early_limit) {
      values.push_back(fit.residual[i]);
    }
  }
  double edge = fit.early_limit;
  if (values.size() < kMost + kNext + 1) return edge;
  std::ranges::partial_sort(values, values.begin() + kMost + kNext + 1);
  for (std::size_t k = 0; k < kMost; ++k) {
    const double spacing = (values[k + 1 + kNext] - values[k + 1]) / static_cast<double>(kNext);
    if (values[k + 1] - values[k] > kGap * spacing) edge = (values[k] + values[k + 1]) / 2;
  }
  return edge;
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

Envelope lower_envelope(std::span<const double> slots, std::span<const double> times,
                        bool posterior_mean) {
  if (slots.size() < 2) return {};
  // The hull's edge over the mean slot has the least sum of residuals among all lines below.
  std::vector<std::size_t> hull;
  double mean = 0;
  for (std::size_t i = 0; i < slots.size(); ++i) {
    mean += slots[i];
    while (hull.size() >= 2) {
      const std::size_t a = hull[hull.size() - 2], b = hull.back();
      const double turn = (slots[b] - slots[a]) * (times[i] - times[a]) -
                          (times[b] - times[a]) * (slots[i] - slots[a]);
      if (turn > 0) break;
      hull.pop_back();
    }
    hull.push_back(i);
  }
  mean /= static_cast<double>(slots.size());
  std::size_t edge = 1;
  while (edge + 1 < hull.size() && slots[hull[edge]] < mean) ++edge;
  const auto slope = [&](std::size_t e) {
    const std::size_t a = hull[e - 1], b = hull[e];
    return (times[b] - times[a]) / (slots[b] - slots[a]);
  };
  Envelope envelope;
  const std::size_t a = hull[edge - 1];
  envelope.line.period = slope(edge);
  envelope.line.origin = times[a] - envelope.line.period * slots[a];
  for (std::size_t i = 0; i < slots.size(); ++i) {
    envelope.sum += times[i] - envelope.line.origin - envelope.line.period * slots[i];
  }
  if (!posterior_mean || envelope.sum <= 0) return envelope;

  // With exponential delays of mean m the likelihood of a line under all points is
  // exp(n / m * its height at the mean slot). Lines of slope s touch the hull at one vertex:
  // between the slopes of two edges the logarithm of the posterior of s is a straight line.
  const auto count = static_cast<double>(slots.size());
  const double rate = count * std::max(count - 2, 1.0) / envelope.sum;
  const auto height = [&](std::size_t vertex, double s) {
    return times[hull[vertex]] + s * (mean - slots[hull[vertex]]);
  };
  const double top = height(edge, slope(edge));
  double weight = 0, mean_slope = 0, mean_height = 0;
  for (std::size_t v = 0; v < hull.size(); ++v) {
    // d(log posterior)/ds; the slopes about the best edge's, so that differences stay exact.
    const double gain = rate * (mean - slots[hull[v]]);
    if (gain == 0) continue;
    const double low = v > 0 ? slope(v) - envelope.line.period : 0;
    const double high = v + 1 < hull.size() ? slope(v + 1) - envelope.line.period : 0;
    const double from = v > 0 ? low : high - 40 / std::abs(gain);
    const double to = v + 1 < hull.size() ? high : low + 40 / std::abs(gain);
    const auto log_posterior = [&](double s) {
      return rate * (height(v, s + envelope.line.period) - top);
    };
    // Integral of exp(gain s), s exp(gain s) between from and to, without overflow.
    const double at_from = std::exp(log_posterior(from)), at_to = std::exp(log_posterior(to));
    const double integral = (at_to - at_from) / gain;
    const double moment = (to * at_to - from * at_from) / gain - integral / gain;
    const double log_moment =
        (at_to * log_posterior(to) - at_from * log_posterior(from)) / gain - integral;
    weight += integral;
    mean_slope += moment;
    // The height itself lies one mean of its own exponential below the hull.
    mean_height += (log_moment - integral) / rate;
  }
  if (!(weight > 0)) return envelope;
  envelope.line.period += mean_slope / weight;
  envelope.line.origin = top + mean_height / weight - envelope.line.period * mean;
  return envelope;
}

void update_residuals(const CameraLine& camera) {
  ClockFit& fit = *camera.fit;
  fit.residual.assign(fit.slots.size(), 0);
  std::vector<double> values;
  values.reserve(fit.slots.size());
  double shift = 0;
  std::size_t next = 0, counted = 0;
  for (std::size_t i = 0; i < fit.slots.size(); ++i) {
    for (; next < fit.breaks.size() && fit.breaks[next].first_frame <= i; ++next) {
      shift += fit.breaks[next].step;
    }
    if (fit.slots[i] == kNoSlot) continue;
    ++counted;
    fit.residual[i] = camera.times[i] - shift - fit.lattice.at(fit.slots[i]);
    values.push_back(fit.residual[i]);
  }
  const double low = quantile(values, 0.05), middle = quantile(values, 0.5),
               high = quantile(values, 0.95);
  fit.jitter = (quantile(values, 0.8413) - quantile(values, 0.1587)) / 2;
  const double least = std::max(fit.jitter / 2, kLeastJitter);
  fit.early_limit = middle - kOutlier * std::max((middle - low) / kTail, least);
  fit.late_limit = middle + kOutlier * std::max((high - middle) / kTail, least);
  std::size_t outliers = 0;
  for (std::size_t i = 0; i < fit.slots.size(); ++i) outliers += fit.is_outlier(i) ? 1 : 0;
  fit.regular =
      counted >= 2 && 10 * outliers <= fit.slots.size() && fit.jitter < fit.lattice.period / 5;
}

void fit_least_squares(std::span<const CameraLine> group) {
  const int steps = group_steps_of(group);
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
    for (PhaseBreak& b : fit.breaks) {
      b.step = b.group_step < 0 ? own(next++) : group_steps(b.group_step);
    }
    Eigen::VectorXd unit = Eigen::VectorXd::Zero(e.own.rows());
    unit(1) = 1;
    fit.period_sigma = std::sqrt(std::max(solvers[c].solve(unit)(1), 0.0));
  }
}

void fit_envelope(std::span<const CameraLine> group) {
  // Twice, as each step is moved with the others held.
  for (int round = 0; round < 2; ++round) {
    for (int step = 0; step < group_steps_of(group); ++step) {
      std::vector<CameraLine> cameras;
      std::vector<std::size_t> index_of;
      for (const CameraLine& camera : group) {
        const auto found = std::ranges::find(camera.fit->breaks, step, &PhaseBreak::group_step);
        if (found == camera.fit->breaks.end() || !camera.fit->regular) continue;
        cameras.push_back(camera);
        index_of.push_back(static_cast<std::size_t>(found - camera.fit->breaks.begin()));
      }
      const double correction = step_correction(cameras, index_of);
      for (const CameraLine& camera : group) {
        for (PhaseBreak& b : camera.fit->breaks) b.step += b.group_step == step ? correction : 0;
      }
    }
    for (const CameraLine& camera : group) {
      for (std::size_t b = 0; b < camera.fit->breaks.size(); ++b) {
        if (camera.fit->breaks[b].group_step >= 0) continue;
        camera.fit->breaks[b].step += step_correction({&camera, 1}, {&b, 1});
      }
    }
  }
  for (const CameraLine& camera : group) {
    if (!camera.fit->regular) continue;
    const Points points = points_of(camera);
    if (points.slots.size() < 3) continue;
    camera.fit->lattice = lower_envelope(points.slots, points.times, true).line;
  }
}

}  // namespace raystage
