// SPDX-License-Identifier: Apache-2.0
// Estimates period and phase of one free-running camera and assigns its frames to slots. The phase
// is the circular mean over blocks of 32 frames; a line through the unwrapped phases of blocks
// corrects the period. Slots are assigned in one pass with a bounded chain of corrections. Input:
// increasing times, ns. Cost: O(frames).
#include "store/processing/sync/lattice.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstddef>
#include <numbers>

namespace raystage::store {
namespace {

constexpr double kMaxGap = 8;  // periods; the number of periods in longer gaps is uncertain
constexpr std::size_t kBlock = 32;
constexpr std::size_t kMaxChain = 3;
constexpr double kMinScatter = 0.02;  // cycles; time stamps without scatter need a tolerance, too
constexpr double kEarly = 0.1;        // cycles

struct BlockPhase {
  double time = 0, cycles = 0;
};

std::vector<BlockPhase> block_phases(std::span<const double> times, double period) {
  std::vector<BlockPhase> blocks;
  const std::size_t count = std::max<std::size_t>(1, times.size() / kBlock);
  for (std::size_t b = 0; b < count; ++b) {
    const auto part = times.subspan(b * times.size() / count,
                                    (b + 1) * times.size() / count - b * times.size() / count);
    std::complex<double> sum = 0;
    double time = 0;
    for (const double t : part) {
      sum += std::polar(1.0, 2 * std::numbers::pi * std::fmod(t, period) / period);
      time += t;
    }
    double cycles = std::arg(sum) / (2 * std::numbers::pi);
    if (!blocks.empty()) {
      cycles += std::round(blocks.back().cycles - cycles);  // the nearest to the block before
    }
    blocks.push_back({time / static_cast<double>(part.size()), cycles});
  }
  return blocks;
}

}  // namespace

double quantile(std::span<double> values, double share) {
  if (values.empty()) return 0;
  const auto at =
      static_cast<std::size_t>(std::llround(share * static_cast<double>(values.size() - 1)));
  std::ranges::nth_element(values, values.begin() + static_cast<std::ptrdiff_t>(at));
  return values[at];
}

double estimate_period(std::span<const double> times) {
  std::vector<double> intervals;
  for (std::size_t i = 1; i < times.size(); ++i) {
    if (times[i] > times[i - 1]) intervals.push_back(times[i] - times[i - 1]);
  }
  if (intervals.empty()) return 0;
  const double median = quantile(intervals, 0.5);
  double time = 0, frames = 0;
  for (const double interval : intervals) {
    const double count = std::round(interval / median);
    if (count > kMaxGap) continue;
    time += interval;
    frames += count;
  }
  return time / frames;
}

Lattice fit_lattice(std::span<const double> times, double period) {
  const std::vector<BlockPhase> blocks = block_phases(times, period);
  double mean_time = 0, mean_cycles = 0;
  for (const BlockPhase& block : blocks) {
    mean_time += block.time / static_cast<double>(blocks.size());
    mean_cycles += block.cycles / static_cast<double>(blocks.size());
  }
  double across = 0, along = 0;
  for (const BlockPhase& block : blocks) {
    along += (block.time - mean_time) * (block.time - mean_time);
    across += (block.time - mean_time) * (block.cycles - mean_cycles);
  }
  const double slope = along > 0 ? across / along : 0;
  const double cycles_at_zero = mean_cycles - slope * mean_time;
  // At exposures, t / period - slot equals the phase at t.
  Lattice lattice;
  lattice.period = 1 / (1 / period - slope);
  lattice.origin = lattice.period * cycles_at_zero;
  return lattice;
}

ResidualQuantiles residual_quantiles(std::span<const double> times, const Lattice& lattice) {
  std::vector<double> cycles;
  cycles.reserve(times.size());
  for (const double time : times) {
    const double c = (time - lattice.origin) / lattice.period;
    cycles.push_back(c - std::round(c));
  }
  ResidualQuantiles scatter;
  scatter.low = quantile(cycles, 0.05);
  scatter.middle = quantile(cycles, 0.5);
  scatter.high = quantile(cycles, 0.95);
  return scatter;
}

std::vector<std::int64_t> assign_slots(std::span<const double> times, const Lattice& lattice,
                                       const ResidualQuantiles& scatter) {
  const double below = scatter.middle - scatter.low + kMinScatter;
  const double above = scatter.high - scatter.middle + kMinScatter;
  const double early = std::clamp(below / (below + above), 0.15, 0.85) - scatter.middle;
  std::vector<std::int64_t> slots(times.size());
  std::vector<std::size_t> kept;  // frames that have a slot
  for (std::size_t i = 0; i < times.size(); ++i) {
    const double cycles = (times[i] - lattice.origin) / lattice.period;
    slots[i] = static_cast<std::int64_t>(std::floor(cycles + early));
    if (kept.empty() || slots[i] > slots[kept.back()]) {
      kept.push_back(i);
      continue;
    }
    const auto claim = slots[i];
    std::size_t chain = 1;  // number of kept frames that would move back by one
    const auto deviation = [&](std::size_t frame) {  // cycles
      return (times[frame] - lattice.at(slots[frame])) / lattice.period - scatter.middle;
    };
    const auto has_free_slot = [&](std::size_t length) {
      const std::size_t first = kept.size() - length;
      if (first > 0) return slots[kept[first]] - slots[kept[first - 1]] >= 2;
      // The slot before the first frame is free, but only for frames that are early.
      return std::ranges::all_of(kept, [&](std::size_t k) { return deviation(k) < -kEarly; });
    };
    while (chain <= kMaxChain && chain <= kept.size() && !has_free_slot(chain)) ++chain;
    if (claim == slots[kept.back()] && chain <= std::min(kMaxChain, kept.size())) {
      for (std::size_t k = kept.size() - chain; k < kept.size(); ++k) --slots[kept[k]];
      kept.push_back(i);
      continue;
    }
    const auto miss = [&](std::size_t frame) {
      return std::abs(times[frame] - lattice.at(claim) - scatter.middle * lattice.period);
    };
    if (claim == slots[kept.back()] && miss(i) < miss(kept.back())) {
      slots[kept.back()] = kNoSlot;
      kept.back() = i;
    } else {
      slots[i] = kNoSlot;
    }
  }
  return slots;
}

}  // namespace raystage::store
