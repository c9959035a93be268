// SPDX-License-Identifier: Apache-2.0
// Detects the rate and the phase of the ticks of a timeline from frame times in ns. Rate: robust
// mean interval relative to the median interval, O(frames). Phase: circular histogram of frame
// phases with 1024 bins; every bin border is tried as the cut, O(frames + bins).
#include "store/tick_phase.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>

namespace raystage::store {
namespace {

// Longer gaps could be miscounted if the median interval is wrong by a few per cent.
constexpr double kLongestGap = 8;

constexpr std::size_t kBins = 1024;
constexpr std::size_t kGuardBins = kBins / 64;  // on each side of the border: 1 ms at 15 Hz

struct Bin {
  double count = 0, sum = 0, squares = 0;  // of phases in [0, 1)
};

double phase_of(Nanoseconds time, double period) {
  double phase = std::fmod(static_cast<double>(time), period) / period;
  if (phase < 0) phase += 1;
  return phase < 1 ? phase : 0;
}

}  // namespace

double detect_frame_rate(const std::vector<std::vector<Nanoseconds>>& times) {
  std::vector<Nanoseconds> intervals;
  for (const auto& column : times) {
    for (std::size_t i = 1; i < column.size(); ++i) {
      if (column[i] > column[i - 1]) intervals.push_back(column[i] - column[i - 1]);
    }
  }
  if (intervals.empty()) return 0;
  const auto middle = intervals.begin() + static_cast<std::ptrdiff_t>(intervals.size() / 2);
  std::nth_element(intervals.begin(), middle, intervals.end());
  const auto median = static_cast<double>(*middle);
  double time = 0, frames = 0;
  for (const Nanoseconds interval : intervals) {
    const double count = std::round(static_cast<double>(interval) / median);
    if (count < 1 || count > kLongestGap) continue;
    time += static_cast<double>(interval);
    frames += count;
  }
  return frames * static_cast<double>(kNanosecondsPerSecond) / time;
}

double best_tick_phase(const std::vector<std::vector<Nanoseconds>>& times, double period) {
  std::array<Bin, kBins> bins{};
  Bin all;
  for (const auto& column : times) {
    for (const Nanoseconds time : column) {
      if (time == std::numeric_limits<Nanoseconds>::min()) continue;  // excluded
      const double phase = phase_of(time, period);
      Bin& bin = bins[std::min(static_cast<std::size_t>(phase * kBins), kBins - 1)];
      for (Bin* b : {&bin, &all}) {
        b->count += 1;
        b->sum += phase;
        b->squares += phase * phase;
      }
    }
  }
  if (all.count == 0) return 0;

  // Cut the circle at the border b: phases below it count as one period later, and the tick is half
  // a period after the border.
  double near_border = 0;
  for (std::size_t i = 0; i < 2 * kGuardBins; ++i) {
    near_border += bins[(kBins - kGuardBins + i) % kBins].count;
  }
  double best_cost = 0, best_border = 0, best_mean = 0;
  Bin below;  // of phases below the border
  for (std::size_t i = 0; i < kBins; ++i) {
    const double border = static_cast<double>(i) / kBins;
    const double sum = all.sum + below.count;
    const double squares = all.squares + 2 * below.sum + below.count;
    const double tick = border + 0.5;
    const double mean = sum / all.count;
    const double mean_square = squares / all.count - 2 * tick * mean + tick * tick;
    const double cost = mean_square + near_border / all.count;
    if (i == 0 || cost < best_cost) {
      best_cost = cost;
      best_border = border;
      best_mean = mean;
    }
    below.count += bins[i].count;
    below.sum += bins[i].sum;
    below.squares += bins[i].squares;
    near_border += bins[(i + kGuardBins) % kBins].count;
    near_border -= bins[(i + kBins - kGuardBins) % kBins].count;
  }
  // The mean is the exact minimum if it is within the bin.
  const double tick =
      std::clamp(best_mean, best_border + 0.5 - 1.0 / kBins, best_border + 0.5 + 1.0 / kBins);
  const double phase = (tick - std::floor(tick)) * period;
  // A phase within one nanosecond of the period is 0: a take that starts at 0 has a tick at 0.
  return period - phase < 0.5 ? 0 : phase;
}

}  // namespace raystage::store
