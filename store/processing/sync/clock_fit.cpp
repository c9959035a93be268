// SPDX-License-Identifier: Apache-2.0
// Fits the clock of each camera: frame times = period * slot + phase + clock steps + delay. Per
// group of cameras with one clock, the slots of the frames are counted (lattice.h). A line is
// fitted by Huber's M-estimator or, if delays are never negative, as lower envelope (line_fit.h).
// Clock steps that all cameras share and those of single cameras are found (clock_steps.h) and
// removed, and the fit repeats. The method with the smaller variance of periods from quarters of
// the recording is chosen. Periods of a group are shrunk towards each other as far as their
// standard errors allow. Input: increasing times per camera, ns. Cost: O(frames log frames) per
// camera.
#include "store/processing/sync/clock_fit.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "base/parallel.h"
#include "store/processing/sync/clock_steps.h"
#include "store/processing/sync/envelope.h"
#include "store/processing/sync/line_fit.h"
#include "store/processing/sync/refine_phase_steps.h"

namespace raystage::store {
namespace {

constexpr PhaseStepOptions kOfGroup{7, 0.02}, kOfOneCamera{9, 0.1};
constexpr std::size_t kSubsets = 4, kMinFramesToCompare = 64;
constexpr std::size_t kMinCamerasToShare = 4;
constexpr double kEarlyShare = 0.1;        // of a period, if time stamps are never early
constexpr double kMaxVarianceRatio = 0.5;  // of the envelope, to choose it

using Group = std::vector<std::size_t>;  // cameras that one clock stamps

// Returns time stamps minus the known phase steps.
std::vector<double> without_phase_steps(std::span<const double> times, const ClockFit& fit,
                                        bool own_too) {
  std::vector<double> moved(times.begin(), times.end());
  for (const PhaseStep& b : fit.phase_steps) {
    if (b.group_step < 0 && !own_too) continue;
    for (std::size_t i = b.first_frame; i < moved.size(); ++i) moved[i] -= b.step;
  }
  return moved;
}

void add_group_steps(const std::vector<std::vector<double>>& times, const Group& group,
                     std::vector<ClockFit>& fits) {
  std::vector<std::vector<double>> columns;
  std::vector<double> periods;
  for (const std::size_t c : group) {
    columns.push_back(times[c]);
    periods.push_back(fits[c].lattice.period);
  }
  const auto shifts = find_phase_steps(columns, periods, kOfGroup);
  for (std::size_t s = 0; s < shifts.size(); ++s) {
    for (std::size_t k = 0; k < group.size(); ++k) {
      fits[group[k]].phase_steps.push_back(
          {shifts[s].first_frame[k], shifts[s].step, static_cast<int>(s)});
    }
  }
}

void add_own_phase_steps(const std::vector<double>& times, ClockFit& fit) {
  const std::vector<std::vector<double>> column{without_phase_steps(times, fit, false)};
  const double period = fit.lattice.period;
  for (const DetectedPhaseStep& shift : find_phase_steps(column, {&period, 1}, kOfOneCamera)) {
    fit.phase_steps.push_back({shift.first_frame[0], shift.step, -1});
  }
  std::ranges::stable_sort(fit.phase_steps, {}, &PhaseStep::first_frame);
}

void count(const std::vector<double>& times, ClockFit& fit) {
  const std::vector<double> moved = without_phase_steps(times, fit, true);
  fit.lattice = fit_lattice(moved, fit.lattice.period);
  fit.slots = assign_slots(moved, fit.lattice, residual_quantiles(moved, fit.lattice));
}

// Adds whole periods to a clock step, since a phase shift is known modulo the period. A clock step
// makes no camera lose frames, so the number of periods is the one that leaves most cameras without
// a gap.
bool add_whole_periods(const std::vector<std::vector<double>>& times, const Group& group, int step,
                       std::vector<ClockFit>& fits) {
  std::vector<double> gaps;
  for (const std::size_t c : group) {
    ClockFit& fit = fits[c];
    const auto found = std::ranges::find(fit.phase_steps, step, &PhaseStep::group_step);
    if (fit.slots.empty() || found == fit.phase_steps.end() || found->first_frame == 0 ||
        found->first_frame >= times[c].size()) {
      continue;
    }
    const std::vector<double> moved = without_phase_steps(times[c], fit, true);
    const auto slot_at = [&](std::size_t i) {
      return std::round((moved[i] - fit.lattice.origin) / fit.lattice.period);
    };
    gaps.push_back(slot_at(found->first_frame) - slot_at(found->first_frame - 1));
  }
  const double extra = gaps.empty() ? 0 : quantile(gaps, 0.5) - 1;
  if (extra == 0) return false;
  for (const std::size_t c : group) {
    for (PhaseStep& b : fits[c].phase_steps) {
      if (b.group_step == step) b.step += extra * fits[group[0]].lattice.period;
    }
  }
  return true;
}

std::vector<CameraLine> lines_of(const std::vector<std::vector<double>>& times, const Group& group,
                                 std::vector<ClockFit>& fits) {
  std::vector<CameraLine> lines;
  for (const std::size_t c : group) {
    if (fits[c].lattice.period > 0) lines.push_back({times[c], &fits[c]});
  }
  return lines;
}

void fit_group(const std::vector<std::vector<double>>& times, const Group& group,
               std::vector<ClockFit>& fits) {
  if (group.size() > 1) add_group_steps(times, group, fits);
  int steps = 0;
  for (const std::size_t c : group) {
    if (fits[c].lattice.period <= 0) continue;
    for (const PhaseStep& b : fits[c].phase_steps) steps = std::max(steps, b.group_step + 1);
    add_own_phase_steps(times[c], fits[c]);
    count(times[c], fits[c]);
  }
  for (int step = 0; step < steps; ++step) {
    if (!add_whole_periods(times, group, step, fits)) continue;
    for (const std::size_t c : group) {
      if (fits[c].lattice.period > 0) count(times[c], fits[c]);
    }
  }
  const std::vector<CameraLine> lines = lines_of(times, group, fits);
  constexpr int kRounds = 4;
  for (int round = 0; round < kRounds; ++round) {
    for (const CameraLine& line : lines) {
      if (round == 1) {  // assign slots again, by the lines of the first round
        const double scale = std::max(line.fit->jitter, 1.0);
        refine_phase_steps(line, {scale, scale, 0.5});
        const auto moved = without_phase_steps(line.times, *line.fit, true);
        line.fit->slots =
            assign_slots(moved, line.fit->lattice, residual_quantiles(moved, line.fit->lattice));
      }
      update_residuals(line);
    }
    fit_least_squares(lines);
  }
  for (const CameraLine& line : lines) update_residuals(line);
}

// Assigns slots again if time stamps are never early: most of a slot's interval is then after it.
void assign_delayed_slots(const CameraLine& line) {
  if (!line.fit->regular) return;
  const double late = std::max(line.fit->jitter, 1.0);
  refine_phase_steps(line, {late / 20, late, kEarlyShare});
  const std::vector<double> moved = without_phase_steps(line.times, *line.fit, true);
  ResidualQuantiles scatter = residual_quantiles(moved, line.fit->lattice);
  scatter.low = scatter.middle;  // leaves the smallest share for early frames
  line.fit->slots = assign_slots(moved, line.fit->lattice, scatter);
}

// Relative variance of the period with a quarter of the frames, for each method.
struct Comparison {
  double least_squares = 0, envelope = 0;
  int cameras = 0;
};

double relative_variance(std::span<const double> periods) {
  double mean = 0, variance = 0;
  const auto count = static_cast<double>(periods.size());
  for (const double p : periods) mean += p / count;
  for (const double p : periods) variance += (p / mean - 1) * (p / mean - 1) / (count - 1);
  return variance;
}

Comparison compare_methods(const std::vector<double>& times, const ClockFit& fit) {
  const std::vector<double> moved = without_phase_steps(times, fit, true);
  const double edge = lower_edge(fit);
  std::vector<double> least_squares, envelope;
  for (std::size_t subset = 0; subset < kSubsets; ++subset) {
    std::vector<double> x, y;
    std::size_t position = 0;
    for (std::size_t i = 0; i < moved.size(); ++i) {
      if (fit.is_outlier(i) || fit.residual[i] < edge || position++ % kSubsets != subset) continue;
      x.push_back(static_cast<double>(fit.slots[i]));
      y.push_back(moved[i]);
    }
    least_squares.push_back(least_squares_line(x, y).period);
    envelope.push_back(lower_envelope(x, y, true).line.period);
  }
  return {relative_variance(least_squares), relative_variance(envelope), 1};
}

Comparison compare_methods(const std::vector<std::vector<double>>& times,
                           const std::vector<ClockFit>& fits) {
  Comparison sum;
  for (std::size_t c = 0; c < fits.size(); ++c) {
    if (!fits[c].regular || times[c].size() < kMinFramesToCompare) continue;
    const Comparison one = compare_methods(times[c], fits[c]);
    sum.least_squares += one.least_squares;
    sum.envelope += one.envelope;
    sum.cameras += 1;
  }
  if (sum.cameras > 0) {
    sum.least_squares /= sum.cameras;
    sum.envelope /= sum.cameras;
  }
  return sum;
}

// Shrinks the periods of a group's cameras towards their mean (empirical Bayes). The weight of a
// camera's own period is V / (V + v): V is the variance of true periods, v that of the camera's
// estimate.
void share_periods(std::span<const CameraLine> group) {
  std::vector<ClockFit*> fits;
  for (const CameraLine& line : group) {
    if (line.fit->regular && line.fit->period_sigma > 0) fits.push_back(line.fit);
  }
  if (fits.size() < kMinCamerasToShare) return;
  std::vector<double> periods;
  for (const ClockFit* fit : fits) periods.push_back(fit->lattice.period);
  const double median = quantile(periods, 0.5);
  std::erase_if(fits, [&](const ClockFit* fit) {  // cameras of another rate
    return std::abs(fit->lattice.period / median - 1) > 1e-3;
  });
  if (fits.size() < kMinCamerasToShare) return;
  double mean = 0, weight = 0, error = 0, spread = 0;
  const auto count = static_cast<double>(fits.size());
  for (const ClockFit* fit : fits) {
    const double w = 1 / (fit->period_sigma * fit->period_sigma);
    mean += w * fit->lattice.period;
    weight += w;
    error += fit->period_sigma * fit->period_sigma / count;
  }
  mean /= weight;
  for (const ClockFit* fit : fits) {
    spread += (fit->lattice.period - mean) * (fit->lattice.period - mean) / (count - 1);
  }
  const double true_variance = std::max(0.0, spread - error);
  for (ClockFit* fit : fits) {
    const double own = fit->period_sigma * fit->period_sigma;
    const double kept = true_variance / (true_variance + own);
    const double period = mean + kept * (fit->lattice.period - mean);
    double middle = 0, frames = 0;
    for (const std::int64_t slot : fit->slots) {
      if (slot == kNoSlot) continue;
      middle += static_cast<double>(slot);
      frames += 1;
    }
    fit->lattice.origin += (fit->lattice.period - period) * middle / frames;
    fit->lattice.period = period;
    fit->period_sigma *= std::sqrt(kept + (1 - kept) / count);
  }
}

}  // namespace

double ClockFit::slots_spanned() const {
  const auto has_slot = [](std::int64_t slot) { return slot != kNoSlot; };
  const auto first = std::ranges::find_if(slots, has_slot);
  if (first == slots.end()) return 0;
  const auto last = std::find_if(slots.rbegin(), slots.rend(), has_slot);
  return static_cast<double>(*last) - static_cast<double>(*first) + 1;
}

double ClockFit::own_steps_before(std::size_t frame) const {
  double sum = 0;
  for (const PhaseStep& b : phase_steps)
    sum += b.group_step < 0 && b.first_frame <= frame ? b.step : 0;
  return sum;
}

ClockFits fit_clocks(const std::vector<std::vector<double>>& times, const std::vector<int>& group,
                     const ClockFitOptions& options) {
  ClockFits result;
  result.cameras.resize(times.size());
  std::map<int, Group> by_number;
  for (std::size_t c = 0; c < times.size(); ++c) {
    by_number[group[c]].push_back(c);
    ClockFit& fit = result.cameras[c];
    fit.slots.assign(times[c].size(), kNoSlot);
    fit.residual.assign(times[c].size(), 0);
    if (times[c].size() >= 3) fit.lattice.period = estimate_period(times[c]);
  }
  std::vector<Group> groups;
  for (auto& [number, members] : by_number) groups.push_back(std::move(members));
  const auto each_group = [&](const auto& body) {
    parallel_for(std::size_t{0}, groups.size(), [&](std::size_t g) { body(groups[g]); });
  };
  each_group([&](const Group& members) { fit_group(times, members, result.cameras); });

  if (options.choose_method) {
    const Comparison comparison = compare_methods(times, result.cameras);
    result.least_squares_ppm = std::sqrt(comparison.least_squares) * 1e6;
    result.envelope_ppm = std::sqrt(comparison.envelope) * 1e6;
    if (comparison.cameras > 0 &&
        comparison.envelope < kMaxVarianceRatio * comparison.least_squares) {
      result.method = ClockFitMethod::kEnvelope;
    }
  }
  each_group([&](const Group& members) {
    const std::vector<CameraLine> lines = lines_of(times, members, result.cameras);
    if (result.method == ClockFitMethod::kEnvelope) {
      fit_envelope(lines);
      for (const CameraLine& line : lines) {
        assign_delayed_slots(line);
        update_residuals(line);
        line.fit->early_limit = std::max(line.fit->early_limit, -line.fit->jitter / 2);
        // The error of an envelope is inversely proportional to the number of frames.
        line.fit->period_sigma = result.envelope_ppm * 1e-6 * line.fit->lattice.period / kSubsets;
      }
    } else if (options.share_periods) {
      share_periods(lines);
      for (const CameraLine& line : lines) update_residuals(line);
    }
  });
  return result;
}

}  // namespace raystage::store
