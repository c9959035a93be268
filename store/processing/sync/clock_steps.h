// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <span>
#include <vector>

namespace raystage::store {

/// A sudden shift of a group's time stamps relative to the periods of the cameras.
struct DetectedPhaseStep {
  double step = 0;  ///< ns, modulo the period: within half a period of 0
  /// For each camera the index of its first frame after the shift, or its number of frames if there
  /// is none.
  std::vector<std::size_t> first_frame;
};

struct PhaseStepOptions {
  double min_z_score = 7;             ///< of the shift divided by its standard error
  double min_period_fraction = 0.02;  ///< of the shift divided by the period
};

/// Returns the shifts that the cameras share (for one camera: its own), by increasing time.
/// Compares the mean phases of 24 frames of each camera before and after each instant. A shift is
/// detected if the mean of the differences, weighted by precision, is significant and at least
/// three quarters of the cameras agree. `times[c]`: increasing, ns; `periods[c]`: from
/// estimate_period().
std::vector<DetectedPhaseStep> find_phase_steps(std::span<const std::vector<double>> times,
                                                std::span<const double> periods,
                                                const PhaseStepOptions& options);

}  // namespace raystage::store
