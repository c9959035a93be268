// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <limits>
#include <span>
#include <vector>

namespace raystage::store {

/// The exposure times of a free-running camera: origin + slot * period, ns, slot any integer.
struct Lattice {
  double origin = 0, period = 0;
  double at(std::int64_t slot) const { return origin + static_cast<double>(slot) * period; }
};

/// The slot of a frame that has no free slot.
inline constexpr std::int64_t kNoSlot = std::numeric_limits<std::int64_t>::min();

/// Returns the period of one camera from increasing times, ns, or 0 without two different times.
/// The median interval counts as one period; the sum of all intervals up to eight periods is
/// divided by their number of periods. Accuracy: the jitter divided by the camera's running time.
double estimate_period(std::span<const double> times);

/// Returns period and origin from circular means over blocks of 32 frames, which dropped frames and
/// a few outliers hardly affect. `period` must be accurate to a few per mille.
Lattice fit_lattice(std::span<const double> times, double period);

/// The 5 %, 50 % and 95 % quantiles of the difference of time stamp and nearest slot, as a fraction
/// of the period in [-0.5, 0.5].
struct ResidualQuantiles {
  double low = 0, middle = 0, high = 0;
};
/// Returns the quantiles for a camera's time stamps (ns).
ResidualQuantiles residual_quantiles(std::span<const double> times, const Lattice& lattice);

/// Returns the slot of each frame, strictly increasing except for kNoSlot. `scatter` sets the
/// boundary between two slots: if time stamps are late further than early, a slot's interval
/// extends further after it. If two frames claim one slot, the earlier frames move back by one slot
/// if one is free at most three frames before. Otherwise the frame that is further from the slot
/// has none.
std::vector<std::int64_t> assign_slots(std::span<const double> times, const Lattice& lattice,
                                       const ResidualQuantiles& scatter);

/// Returns the quantile of the values at `share` in [0, 1], or 0 without values. Reorders them.
double quantile(std::span<double> values, double share);

}  // namespace raystage::store
