// SPDX-License-Identifier: Apache-2.0
// Fits the lower envelope of (slot, time) pairs, for time stamps that are delayed but never early.
// The line with the least sum of residuals is the edge of the lower convex hull over the mean slot.
// For exponential delays, the posterior mean over all lines below is integrated exactly, piece by
// piece over the hull's vertices (Pitman's estimator). Phase steps are found by golden section
// search of the joint likelihood. Times in ns. Cost: O(frames) per line, O(hull) per trial step.
#include "store/processing/sync/envelope.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace raystage::store {
namespace {

// The frames that the fit uses, with phase steps subtracted.
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
    for (; next < fit.phase_steps.size() && fit.phase_steps[next].first_frame <= i; ++next) {
      shift += fit.phase_steps[next].step;
    }
    if (fit.slots[i] == kNoSlot || fit.residual[i] < edge) continue;
    points.slots.push_back(static_cast<double>(fit.slots[i]));
    points.times.push_back(camera.times[i] - shift);
    points.frames.push_back(i);
  }
  return points;
}

// Returns the minimum of a convex function in [low, high].
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

// Returns the indices of the lower hull of points with increasing slots.
std::vector<std::size_t> lower_hull(std::span<const double> slots, std::span<const double> times) {
  std::vector<std::size_t> hull;
  for (std::size_t i = 0; i < slots.size(); ++i) {
    while (hull.size() >= 2) {
      const std::size_t a = hull[hull.size() - 2], b = hull.back();
      const double turn = (slots[b] - slots[a]) * (times[i] - times[a]) -
                          (times[b] - times[a]) * (slots[i] - slots[a]);
      if (turn > 0) break;
      hull.pop_back();
    }
    hull.push_back(i);
  }
  return hull;
}

// Returns the index of the right end of the hull's edge over `slot`.
std::size_t edge_over(std::span<const std::size_t> hull, std::span<const double> slots,
                      double slot) {
  std::size_t edge = 1;
  while (edge + 1 < hull.size() && slots[hull[edge]] < slot) ++edge;
  return edge;
}

// A camera's points on both sides of a phase step, reduced to the hull of each side. For any size
// of the step, the hull of all points is the hull of both hulls.
struct TwoSides {
  std::vector<double> slots, times;
  std::size_t left = 0;  // points before the step
  double count = 0, count_right = 0, mean_slot = 0, mean_time = 0;

  TwoSides(const Points& points, std::size_t first_frame) {
    const auto split = static_cast<std::size_t>(
        std::ranges::lower_bound(points.frames, first_frame) - points.frames.begin());
    count = static_cast<double>(points.slots.size());
    count_right = count - static_cast<double>(split);
    for (std::size_t i = 0; i < points.slots.size(); ++i) {
      mean_slot += points.slots[i] / count;
      mean_time += points.times[i] / count;
    }
    const auto add = [&](std::size_t begin, std::size_t end) {
      const auto s = std::span(points.slots).subspan(begin, end - begin);
      const auto t = std::span(points.times).subspan(begin, end - begin);
      for (const std::size_t i : lower_hull(s, t)) {
        slots.push_back(s[i]);
        times.push_back(t[i]);
      }
    };
    add(0, split);
    left = slots.size();
    add(split, points.slots.size());
  }
  // Returns the sum of residuals over the envelope if the right side is moved down by `delta` ns.
  double misfit(double delta) const {
    if (slots.size() < 2) return 0;
    std::vector<double> moved = times;
    for (std::size_t i = left; i < moved.size(); ++i) moved[i] -= delta;
    const auto hull = lower_hull(slots, moved);
    if (hull.size() < 2) return 0;
    const std::size_t edge = edge_over(hull, slots, mean_slot);
    const std::size_t a = hull[edge - 1], b = hull[edge];
    const double height =
        moved[a] + (moved[b] - moved[a]) / (slots[b] - slots[a]) * (mean_slot - slots[a]);
    return count * (mean_time - height) - count_right * delta;
  }
};

// Returns the common correction, ns, of the steps phase_steps[index_of[c]] with which the envelopes
// of the cameras fit best.
double step_correction(std::span<const CameraLine> cameras, std::span<const std::size_t> index_of) {
  std::vector<TwoSides> sides;
  double jitter = 0;
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    sides.emplace_back(points_of(cameras[c]), cameras[c].fit->phase_steps[index_of[c]].first_frame);
    jitter = std::max(jitter, cameras[c].fit->jitter);
  }
  const auto misfit = [&](double delta) {  // minus the log likelihood
    double sum = 0;
    for (const TwoSides& camera : sides) sum += camera.misfit(delta);
    return sum;
  };
  const double best = golden_section(-jitter, jitter, misfit);
  if (jitter == 0) return best;

  // As for the line, the posterior mean has a smaller error than the mode. For exponential
  // delays the measured jitter is 0.83 of the mean delay.
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
  constexpr std::size_t kMax = 3, kNext = 20;
  constexpr double kGap = 15;  // probability 1 in 3 million for exponential delays
  std::vector<double> values;
  for (std::size_t i = 0; i < fit.slots.size(); ++i) {
    if (fit.slots[i] != kNoSlot && fit.residual[i] >= fit.early_limit) {
      values.push_back(fit.residual[i]);
    }
  }
  double edge = fit.early_limit;
  if (values.size() < kMax + kNext + 1) return edge;
  std::ranges::partial_sort(values, values.begin() + kMax + kNext + 1);
  for (std::size_t k = 0; k < kMax; ++k) {
    const double spacing = (values[k + 1 + kNext] - values[k + 1]) / static_cast<double>(kNext);
    if (values[k + 1] - values[k] > kGap * spacing) edge = (values[k] + values[k + 1]) / 2;
  }
  return edge;
}

Envelope lower_envelope(std::span<const double> slots, std::span<const double> times,
                        bool posterior_mean) {
  if (slots.size() < 2) return {};
  const std::vector<std::size_t> hull = lower_hull(slots, times);
  const double mean =
      std::reduce(slots.begin(), slots.end(), 0.0) / static_cast<double>(slots.size());
  const std::size_t edge = edge_over(hull, slots, mean);
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
    // d(log posterior)/ds. Slopes are relative to the best edge's, so that differences stay exact.
    const double gain = rate * (mean - slots[hull[v]]);
    const double low = v > 0 ? slope(v) - envelope.line.period : 0;
    const double high = v + 1 < hull.size() ? slope(v + 1) - envelope.line.period : 0;
    const double from = v > 0 ? low : high - 40 / std::abs(gain);
    const double to = v + 1 < hull.size() ? high : low + 40 / std::abs(gain);
    const auto log_posterior = [&](double s) {
      return rate * (height(v, s + envelope.line.period) - top);
    };
    // Integral of exp(gain s), s exp(gain s) between from and to, without overflow.
    const double at_from = std::exp(log_posterior(from)), at_to = std::exp(log_posterior(to));
    double integral = 0, moment = 0, log_moment = 0;
    constexpr double kFlat = 1e-3;
    if (std::abs(gain) * (to - from) < kFlat) {
      // The vertex is at the mean slot, or so near that differences divided by the gain are lost in
      // rounding. Simpson's rule is exact for a constant posterior, and here to 1e-15.
      const double middle = (from + to) / 2, sixth = (to - from) / 6;
      const double at_middle = 4 * std::exp(log_posterior(middle));
      integral = sixth * (at_from + at_middle + at_to);
      moment = sixth * (from * at_from + middle * at_middle + to * at_to);
      log_moment = sixth * (log_posterior(from) * at_from + log_posterior(middle) * at_middle +
                            log_posterior(to) * at_to);
    } else {
      integral = (at_to - at_from) / gain;
      moment = (to * at_to - from * at_from) / gain - integral / gain;
      log_moment = (at_to * log_posterior(to) - at_from * log_posterior(from)) / gain - integral;
    }
    weight += integral;
    mean_slope += moment;
    // The expected height is below the hull by the mean of its own exponential distribution.
    mean_height += (log_moment - integral) / rate;
  }
  if (!(weight > 0)) return envelope;
  envelope.line.period += mean_slope / weight;
  envelope.line.origin = top + mean_height / weight - envelope.line.period * mean;
  return envelope;
}

void fit_envelope(std::span<const CameraLine> group) {
  // Two rounds, because each step is corrected with the others fixed.
  for (int round = 0; round < 2; ++round) {
    for (int step = 0; step < group_step_count(group); ++step) {
      std::vector<CameraLine> cameras;
      std::vector<std::size_t> index_of;
      for (const CameraLine& camera : group) {
        const auto found = std::ranges::find(camera.fit->phase_steps, step, &PhaseStep::group_step);
        if (found == camera.fit->phase_steps.end() || !camera.fit->regular) continue;
        cameras.push_back(camera);
        index_of.push_back(static_cast<std::size_t>(found - camera.fit->phase_steps.begin()));
      }
      const double correction = step_correction(cameras, index_of);
      for (const CameraLine& camera : group) {
        for (PhaseStep& b : camera.fit->phase_steps)
          b.step += b.group_step == step ? correction : 0;
      }
    }
    for (const CameraLine& camera : group) {
      for (std::size_t b = 0; b < camera.fit->phase_steps.size(); ++b) {
        if (camera.fit->phase_steps[b].group_step >= 0) continue;
        camera.fit->phase_steps[b].step += step_correction({&camera, 1}, {&b, 1});
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

}  // namespace raystage::store
