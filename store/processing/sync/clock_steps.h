// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <span>
#include <vector>

namespace raystage {

/// A sudden shift of a group's stamps against the cameras' own rhythm.
struct PhaseShift {
  double step = 0;  ///< ns, known but for whole periods: within half a period of 0
  /// Per camera the index of its first frame after the shift; the number of its frames where none
  /// is.
  std::vector<std::size_t> first_frame;
};

struct PhaseShiftSettings {
  double least_score = 7;     ///< the shift over its standard error
  double least_share = 0.02;  ///< the shift over the period
};

/// Shifts that the cameras share (one camera: its own), by increasing time. `times[c]` in ns,
/// increasing; `periods[c]` as coarse_period() gives them. Before and after each instant the phases
/// of 24 frames of each camera are averaged; a shift counts where the cameras' differences, each
/// weighted by its precision, are beyond doubt and at least three quarters of the cameras agree.
std::vector<PhaseShift> find_phase_shifts(std::span<const std::vector<double>> times,
                                          std::span<const double> periods,
                                          const PhaseShiftSettings& settings);

}  // namespace raystage
