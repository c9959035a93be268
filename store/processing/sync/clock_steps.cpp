// SPDX-License-Identifier: Apache-2.0
// Detects sudden phase shifts in the time stamps of a group of cameras. The phase of a frame is its
// time modulo the camera's period, as a unit phasor. For instants two periods apart, the mean
// phases of 24 frames before and after are compared, weighted by their circular variance (Mardia),
// and pooled over cameras. The most significant instants are kept; each camera's first frame after
// the shift is the split that fits both phases best. Input: increasing times and periods, ns.
// Output: shifts modulo the period. Cost: O(frames log frames) for each camera, by prefix sums of
// phasors.
#include "store/processing/sync/clock_steps.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <limits>
#include <numbers>
#include <numeric>
#include <optional>

#include "store/processing/sync/lattice.h"

namespace raystage::store {
namespace {

using Phasor = std::complex<double>;

constexpr double kTurn = 2 * std::numbers::pi;
constexpr std::size_t kWindow = 24, kMinFrames = 12;  // frames on each side
constexpr std::size_t kGuard = 6;  // excluded frames next to a shift, whose position is not exact
constexpr double kGridStep = 2;    // periods between tested instants
constexpr double kSamePeriod = 0.01;
constexpr double kNever = std::numeric_limits<double>::infinity();
constexpr double kAgreeingShare = 0.75;

// Prefix sums of phasors: the mean phase of any window is one subtraction.
class PhaseSums {
 public:
  PhaseSums(std::span<const double> times, double period) : times_(times), period_(period) {
    sums_.reserve(times.size() + 1);
    sums_.emplace_back(0);
    for (const double time : times) {
      const double cycles = (time - times[0]) / period;
      sums_.push_back(sums_.back() + std::polar(1.0, kTurn * (cycles - std::round(cycles))));
    }
  }
  std::size_t size() const { return times_.size(); }
  double time(std::size_t i) const { return times_[i]; }
  double period() const { return period_; }
  bool runs_at(double time) const { return times_.front() <= time && time <= times_.back(); }
  // Returns the end of the gap at `time`: the last instant before the next one with windows.
  double empty_until(double time) const {
    for (std::size_t at = first_at(time); at < size(); ++at) {
      if (windows(at)) return times_[at - 1];
    }
    return kNever;
  }
  std::size_t first_at(double time) const {
    return static_cast<std::size_t>(std::ranges::lower_bound(times_, time) - times_.begin());
  }
  Phasor sum(std::size_t begin, std::size_t end) const { return sums_[end] - sums_[begin]; }

  // The windows before the frame `at` and from it on, which must not contain long gaps.
  struct Windows {
    std::size_t begin = 0, at = 0, end = 0;
  };
  std::optional<Windows> windows(std::size_t at) const {
    const Windows w{at - std::min(at, kWindow), at, std::min(size(), at + kWindow)};
    if (w.at - w.begin < kMinFrames || w.end - w.at < kMinFrames) return std::nullopt;
    const double longest = 4.0 * kWindow * period_;
    if (times_[w.end - 1] - times_[w.begin] > longest) return std::nullopt;
    return w;
  }

 private:
  std::span<const double> times_;
  double period_;
  std::vector<Phasor> sums_;
};

struct Difference {
  double angle = 0, variance = 0;  // radians
};

// Returns the variance of the angle of a mean phasor (Mardia: circular variance over n), with a
// floor for windows with little scatter by chance.
double angle_variance(Phasor sum, double count) {
  const double length = std::min(std::abs(sum) / count, 1.0);
  const double one = length > 1e-3 ? -2 * std::log(length) : 14.0;
  return (one + 1e-8) / count;
}

std::optional<Difference> difference_at(const PhaseSums& camera, double time) {
  const auto w = camera.windows(camera.first_at(time));
  if (!w) return std::nullopt;
  const Phasor before = camera.sum(w->begin, w->at), after = camera.sum(w->at, w->end);
  return Difference{std::arg(after * std::conj(before)),
                    angle_variance(before, static_cast<double>(w->at - w->begin)) +
                        angle_variance(after, static_cast<double>(w->end - w->at))};
}

struct Pooled {
  double angle = 0, score = 0;
  bool agreed = false, is_empty = false;  // is_empty: no camera has windows
};

Pooled pool(std::span<const PhaseSums> cameras, double time) {
  std::vector<Difference> differences;
  std::size_t running = 0;
  Phasor sum = 0;
  double weight = 0;
  for (const PhaseSums& camera : cameras) {
    running += camera.runs_at(time) ? 1 : 0;
    const auto d = difference_at(camera, time);
    if (!d) continue;
    differences.push_back(*d);
    sum += std::polar(1 / d->variance, d->angle);
    weight += 1 / d->variance;
  }
  if (differences.empty()) return {.is_empty = true};
  // At least half of the running cameras are needed, and never one alone in a group.
  if (2 * differences.size() < running) return {};
  if (cameras.size() > 1 && differences.size() == 1) return {};
  Pooled pooled;
  pooled.angle = std::arg(sum);
  pooled.score = std::abs(pooled.angle) * std::sqrt(weight);
  const auto agree = std::ranges::count_if(differences, [&](const Difference& d) {
    return std::abs(std::remainder(d.angle - pooled.angle, kTurn)) < 4 * std::sqrt(d.variance);
  });
  pooled.agreed =
      static_cast<double>(agree) >= kAgreeingShare * static_cast<double>(differences.size());
  return pooled;
}

// The tested instants: a grid over the frames of the cameras, without long gaps in which no camera
// has windows. Cost: O(frames) for any times.
class Instants {
 public:
  Instants(std::span<const PhaseSums> cameras, double begin, double end, double step)
      : cameras_(cameras),
        time_(begin),
        end_(end),
        step_(std::max(step, resolution(std::max(std::abs(begin), std::abs(end))))),
        empty_until_(cameras.size(), begin) {}
  bool is_any() const { return time_ <= end_; }
  double time() const { return time_; }
  void advance() { time_ += step_; }
  // Moves from an instant without windows to the last one before the next windows.
  void skip_gap() {
    double last = end_;
    for (std::size_t c = 0; c < cameras_.size(); ++c) {
      if (empty_until_[c] < time_) empty_until_[c] = cameras_[c].empty_until(time_);
      last = std::min(last, empty_until_[c]);
    }
    // A short gap step by step, which rounds as if its instants were tested.
    constexpr double kLong = 1000;
    const double steps = std::floor((last - time_) / step_);
    if (steps > kLong) time_ += (steps - 1) * step_;
    while (time_ + step_ <= last) advance();
  }

 private:
  // A smaller step would be lost in rounding.
  static double resolution(double time) { return std::nextafter(time, kNever) - time; }

  std::span<const PhaseSums> cameras_;
  double time_, end_, step_;
  std::vector<double> empty_until_;  // of each camera, from some earlier instant on
};

// The phases of a camera before and after a shift, without the frames next to it.
struct Sides {
  double before = 0, after = 0;  // radians, as PhaseSums counts them
};
Sides sides_of(const PhaseSums& camera, std::size_t at, double angle) {
  const std::size_t left = at - std::min(at, kGuard);
  const std::size_t right = std::min(camera.size(), at + kGuard);
  const Phasor before = camera.sum(left - std::min(left, kWindow), left);
  const Phasor after = camera.sum(right, std::min(camera.size(), right + kWindow));
  if (std::abs(before) < 1) return {std::arg(after) - angle, std::arg(after)};
  return {std::arg(before), std::arg(before) + angle};
}

// Returns how much better a frame fits the phase before the shift than the one after; negative:
// after.
double preference(const PhaseSums& camera, std::size_t frame, const Sides& sides) {
  const double angle = std::arg(camera.sum(frame, frame + 1));
  const double before = std::remainder(angle - sides.before, kTurn);
  const double after = std::remainder(angle - sides.after, kTurn);
  return after * after - before * before;
}

// Returns the instant that separates the group's frames best.
double split_time(std::span<const PhaseSums> cameras, double time, double angle) {
  struct Vote {
    double time, preference;
  };
  std::vector<Vote> votes;
  for (const PhaseSums& camera : cameras) {
    const std::size_t at = camera.first_at(time);
    const Sides sides = sides_of(camera, at, angle);
    const std::size_t end = std::min(camera.size(), at + kWindow / 2);
    for (std::size_t i = at - std::min(at, kWindow / 2); i < end; ++i) {
      votes.push_back({camera.time(i), preference(camera, i, sides)});
    }
  }
  std::ranges::sort(votes, {}, &Vote::time);
  double sum = 0, best = -std::numeric_limits<double>::infinity(), best_time = time;
  for (const Vote& vote : votes) {
    if (sum > best) {
      best = sum;
      best_time = vote.time;
    }
    sum += vote.preference;
  }
  return best_time;
}

// Returns the first frame of a camera after the shift, within 1.5 periods of the group's instant.
// Cameras differ: after a step back, a later frame of one camera may have an earlier time stamp.
std::size_t split_frame(const PhaseSums& camera, double time, double angle) {
  const std::size_t at = camera.first_at(time);
  const Sides sides = sides_of(camera, at, angle);
  const double reach = 1.5 * camera.period();
  const std::size_t begin = camera.first_at(time - reach), end = camera.first_at(time + reach);
  double sum = 0, best = 0;
  std::size_t best_frame = begin;
  for (std::size_t i = begin; i < end; ++i) {
    sum += preference(camera, i, sides);
    if (sum > best) {
      best = sum;
      best_frame = i + 1;
    }
  }
  return best_frame;
}

// Returns the period corrected by the median of local drifts. A step distorts the average period of
// the whole recording, but not the median.
double robust_period(std::span<const double> times, double period) {
  const PhaseSums camera(times, period);
  std::vector<double> drifts;  // cycles per ns
  for (std::size_t at = kMinFrames; at < times.size(); at += kMinFrames / 2) {
    const auto w = camera.windows(at);
    if (!w) continue;
    const auto mean = [&](std::size_t begin, std::size_t end) {
      return std::reduce(times.begin() + static_cast<std::ptrdiff_t>(begin),
                         times.begin() + static_cast<std::ptrdiff_t>(end), 0.0) /
             static_cast<double>(end - begin);
    };
    const double angle =
        std::arg(camera.sum(w->at, w->end) * std::conj(camera.sum(w->begin, w->at)));
    drifts.push_back(angle / kTurn / (mean(w->at, w->end) - mean(w->begin, w->at)));
  }
  return 1 / (1 / period - quantile(drifts, 0.5));
}

}  // namespace

std::vector<DetectedPhaseStep> find_phase_steps(std::span<const std::vector<double>> times,
                                                std::span<const double> periods,
                                                const PhaseStepOptions& options) {
  std::vector<double> known(periods.begin(), periods.end());
  std::erase(known, 0.0);
  if (known.empty()) return {};
  const double period = quantile(known, 0.5);
  std::vector<PhaseSums> cameras;
  std::vector<bool> usable(times.size());
  double begin = std::numeric_limits<double>::max(), end = std::numeric_limits<double>::lowest();
  for (std::size_t c = 0; c < times.size(); ++c) {
    if (periods[c] <= 0 || std::abs(periods[c] / period - 1) > kSamePeriod) continue;
    usable[c] = true;
    cameras.emplace_back(times[c], robust_period(times[c], periods[c]));
    begin = std::min(begin, times[c].front());
    end = std::max(end, times[c].back());
  }

  struct Candidate {
    double time, angle, score;
  };
  std::vector<Candidate> candidates;
  for (Instants instants(cameras, begin, end, kGridStep * period); instants.is_any();
       instants.advance()) {
    const Pooled pooled = pool(cameras, instants.time());
    if (pooled.is_empty) instants.skip_gap();
    if (pooled.score < options.min_z_score || !pooled.agreed) continue;
    if (std::abs(pooled.angle) < kTurn * options.min_period_fraction) continue;
    candidates.push_back({instants.time(), pooled.angle, pooled.score});
  }
  // By decreasing score; candidates with overlapping windows belong to the same shift.
  std::ranges::stable_sort(candidates, std::greater(), &Candidate::score);
  std::vector<Candidate> chosen;
  for (const Candidate& candidate : candidates) {
    const bool same = std::ranges::any_of(chosen, [&](const Candidate& other) {
      return std::abs(other.time - candidate.time) < 1.25 * kWindow * period;
    });
    if (!same) chosen.push_back(candidate);
  }
  std::ranges::sort(chosen, {}, &Candidate::time);

  std::vector<DetectedPhaseStep> shifts;
  for (const Candidate& candidate : chosen) {
    const double time = split_time(cameras, candidate.time, candidate.angle);
    DetectedPhaseStep shift;
    shift.step = candidate.angle / kTurn * period;
    std::size_t next = 0;
    for (std::size_t c = 0; c < times.size(); ++c) {
      const auto at =
          static_cast<std::size_t>(std::ranges::lower_bound(times[c], time) - times[c].begin());
      shift.first_frame.push_back(usable[c] ? split_frame(cameras[next++], time, candidate.angle)
                                            : at);
    }
    shifts.push_back(std::move(shift));
  }
  return shifts;
}

}  // namespace raystage::store
