// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <limits>
#include <span>
#include <vector>

namespace raystage {

/// Times at which a free-running camera exposes: origin + n * period, ns, n any integer (a slot).
struct Lattice {
  double origin = 0, period = 0;
  double at(std::int64_t slot) const { return origin + static_cast<double>(slot) * period; }
};

/// The slot of a frame that fits nowhere: one more than the camera exposes.
inline constexpr std::int64_t kNoSlot = std::numeric_limits<std::int64_t>::min();

/// Period of one camera from increasing times, ns: the median interval is taken for one frame, then
/// all the time of intervals up to eight frames is divided by their frames. Good to the jitter over
/// the camera's running time. 0 where there are no two different times.
double coarse_period(std::span<const double> times);

/// Period and origin by circular means over blocks of frames: neither drops nor a few outliers
/// count for much, and nothing needs counting. `period` must be good to a few per mille.
Lattice fit_blocks(std::span<const double> times, double period);

/// How far the stamps lie from their slots, as a share of the period in [-0.5, 0.5].
struct Scatter {
  double low = 0, middle = 0, high = 0;  ///< 5 %, 50 %, 95 % quantiles
};
Scatter scatter_of(std::span<const double> times, const Lattice& lattice);

/// The slot of each frame, strictly increasing but for kNoSlot. A stamp counts for the slot before
/// or behind it according to `scatter`: where delays reach further than earliness, so does a slot's
/// share of the time behind it. Where two frames claim one slot, the earlier ones are late and move
/// back if a slot is free at most three frames before; otherwise the worse one has none.
std::vector<std::int64_t> count_frames(std::span<const double> times, const Lattice& lattice,
                                       const Scatter& scatter);

/// The value below which `share` of the values lie; 0 for none. Reorders them.
double quantile(std::span<double> values, double share);

}  // namespace raystage
