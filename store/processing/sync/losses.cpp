// SPDX-License-Identifier: Apache-2.0
// Finds frames lost without a record: slots of the fitted clock without a frame. The end of the
// start-up is the change point of the loss rate with the largest log-likelihood ratio over bins of
// one tick. Times in ns. Cost: O(frames + lost frames) per camera, O(ticks) for the change point.
#include "store/processing/sync/losses.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace raystage::store {
namespace {

constexpr double kMinGain = 12;  // of log likelihood
constexpr double kMinLoss = 0.1, kMinRatio = 3, kMinLost = 5;
constexpr double kMaxBins = 10'000'000;
constexpr double kMaxLost = 1e9;  // of all cameras; no recording loses as many

// Returns the binomial log likelihood of `lost` of `all` frames at the rate lost / all.
double log_likelihood(double lost, double all) {
  if (lost <= 0 || lost >= all) return 0;
  return lost * std::log(lost / all) + (all - lost) * std::log(1 - lost / all);
}

std::int64_t recorded_in(const CameraTimestamps& camera, const CameraClock& clock,
                         const LostRun& run) {
  const double end =
      static_cast<double>(run.time) + (static_cast<double>(run.count) - 0.5) * clock.period_ns;
  const auto begin = std::ranges::partition_point(camera.missing, [&](const FrameRecord& record) {
    return static_cast<double>(clock.corrected(record.time_ns)) <
           static_cast<double>(run.time) - 0.5 * clock.period_ns;
  });
  std::int64_t count = 0;
  for (auto record = begin; record != camera.missing.end(); ++record) {
    if (static_cast<double>(clock.corrected(record->time_ns)) >= end) break;
    ++count;
  }
  return std::min(count, run.count);
}

// Returns whether losses begin with the recording: a gap later in the take is no start-up.
bool begins_with_losses(std::span<const double> lost, std::span<const double> present,
                        std::size_t split) {
  const std::size_t quarter = std::max<std::size_t>(1, split / 4);
  const auto sum = [&](std::span<const double> bins, std::size_t end) {
    return std::reduce(bins.begin(), bins.begin() + static_cast<std::ptrdiff_t>(end));
  };
  const auto rate = [&](std::size_t end) {
    const double missing = sum(lost, end);
    return missing / std::max(1.0, missing + sum(present, end));
  };
  return rate(quarter) >= rate(split) / kMinRatio;
}

std::optional<Nanoseconds> first_time(std::span<const Nanoseconds> times) {
  const auto first = std::ranges::find_if(times, [](auto time) { return time != kExcludedTime; });
  return first == times.end() ? std::nullopt : std::optional(*first);
}

// Returns the number of lost frames of all cameras that find_start_up_end() would count.
double count_lost(std::span<const CameraSync> cameras, const std::vector<CameraClock>& clocks,
                  const std::vector<std::vector<Nanoseconds>>& times, const TimeRange& range) {
  double count = 0;
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    const auto first = first_time(times[c]);
    if (!cameras[c].regular || !first) continue;
    count += std::max(0.0, static_cast<double>(*first - range.begin) / clocks[c].period_ns);
    for (const LostRun& run : cameras[c].lost) count += static_cast<double>(run.count);
  }
  return count;
}

}  // namespace

std::vector<LostRun> find_lost_runs(const CameraTimestamps& camera, const ClockFit& fit,
                                    const CameraClock& clock, Nanoseconds base) {
  std::vector<LostRun> runs;
  std::int64_t first = kNoSlot, previous = kNoSlot;
  for (std::size_t i = 0; i < fit.slots.size(); ++i) {
    const std::int64_t slot = fit.slots[i];
    if (slot == kNoSlot) continue;
    if (first == kNoSlot) first = slot;
    if (previous != kNoSlot && slot > previous + 1) {
      LostRun run;
      run.first = previous + 1 - first;
      run.count = slot - previous - 1;
      run.time = base - clock.offset_ns +
                 std::llround(fit.lattice.at(previous + 1) + fit.own_steps_before(i - 1));
      run.recorded = recorded_in(camera, clock, run);
      runs.push_back(run);
    }
    previous = slot;
  }
  return runs;
}

LostRun find_lost_run_between(const CameraTimestamps& camera, const CameraClock& clock,
                              Nanoseconds last, Nanoseconds next) {
  LostRun run;
  run.count = std::llround(static_cast<double>(next - last) / clock.period_ns) - 1;
  run.time = last + std::llround(clock.period_ns);
  if (run.count > 0) run.recorded = recorded_in(camera, clock, run);
  return run;
}

std::optional<Nanoseconds> find_start_up_end(std::span<const CameraSync> cameras,
                                             const std::vector<CameraClock>& clocks,
                                             const std::vector<std::vector<Nanoseconds>>& times,
                                             const TimeRange& range, double period) {
  const double length = static_cast<double>(range.end - range.begin) / period;
  if (!(length >= 3) || length > kMaxBins) return std::nullopt;
  if (count_lost(cameras, clocks, times, range) > kMaxLost) return std::nullopt;
  const auto bins = static_cast<std::size_t>(length);
  std::vector<double> lost(bins, 0), present(bins, 0);
  const auto bin_of = [&](double time) {
    return std::floor((time - static_cast<double>(range.begin)) / period);
  };
  const auto add = [&](std::vector<double>& to, double time) {
    const double bin = bin_of(time);
    if (bin >= 0 && bin < static_cast<double>(bins)) to[bin] += 1;
  };
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    if (!cameras[c].regular) continue;
    const double own = clocks[c].period_ns;
    const auto first = first_time(times[c]);
    if (!first) continue;
    for (const Nanoseconds time : times[c]) {
      if (time != kExcludedTime) add(present, static_cast<double>(time));
    }
    for (double time = static_cast<double>(*first) - own; time >= static_cast<double>(range.begin);
         time -= own) {
      add(lost, time);
    }
    for (const LostRun& run : cameras[c].lost) {
      for (std::int64_t k = 0; k < run.count; ++k) {
        const double time = static_cast<double>(run.time) + static_cast<double>(k) * own;
        if (time > static_cast<double>(range.end)) break;
        add(lost, time);
      }
    }
  }

  double all_lost = 0, all = 0;
  for (std::size_t b = 0; b < bins; ++b) {
    all_lost += lost[b];
    all += lost[b] + present[b];
  }
  double before_lost = 0, before = 0, best = kMinGain;
  std::optional<std::size_t> split;
  for (std::size_t b = 0; b + 1 < bins && b < 2 * bins / 3; ++b) {
    before_lost += lost[b];
    before += lost[b] + present[b];
    const double after_lost = all_lost - before_lost, after = all - before;
    if (before_lost < kMinLost || after <= 0) continue;
    const double rate = before_lost / before, rate_after = after_lost / after;
    if (rate < kMinLoss || rate < kMinRatio * rate_after) continue;
    const double gain = log_likelihood(before_lost, before) + log_likelihood(after_lost, after) -
                        log_likelihood(all_lost, all);
    if (gain > best) {
      best = gain;
      split = b + 1;
    }
  }
  if (!split || !begins_with_losses(lost, present, *split)) return std::nullopt;
  return range.begin + std::llround(static_cast<double>(*split) * period);
}

}  // namespace raystage::store
