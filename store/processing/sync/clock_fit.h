// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "base/time.h"
#include "store/processing/sync/lattice.h"

namespace raystage::store {

/// A sudden change of the phase of a camera's time stamps.
struct PhaseStep {
  std::size_t first_frame = 0;  ///< the first frame after the step
  double step = 0;              ///< ns; positive: later
  int group_step = -1;          ///< number of the group's common step; -1: this camera only
};

/// The clock fit of one camera: time stamp = lattice.at(slot) + earlier phase steps + delay. Times
/// are in ns since the origin of the times given to fit_clocks().
struct ClockFit {
  Lattice lattice;                         ///< before the first step; period 0: too few frames
  std::vector<std::int64_t> slots;         ///< of each frame, increasing, or kNoSlot
  std::vector<PhaseStep> phase_steps;      ///< by increasing frame
  std::vector<double> residual;            ///< of each frame, ns; 0 without slot
  double jitter = 0;                       ///< robust sigma of the residuals, ns
  double early_limit = 0, late_limit = 0;  ///< residuals outside are outliers, ns
  double period_sigma = 0;                 ///< standard error of the period, ns
  /// Whether the camera has a constant rate. False if more than a tenth of its frames are outliers,
  /// or the jitter exceeds a fifth of the period. Also false if fewer than one slot in 20 has a
  /// frame, or the rate exceeds 10 kHz.
  bool regular = false;

  bool is_outlier(std::size_t frame) const {
    return slots[frame] == kNoSlot || residual[frame] < early_limit || residual[frame] > late_limit;
  }
  /// Returns the number of slots from the first to the last frame with a slot, inclusive, or 0.
  double slots_spanned() const;
  /// Returns the sum of the camera's own phase steps up to a frame, ns.
  double own_steps_before(std::size_t frame) const;
};

/// The estimator of the line through slots and time stamps.
enum class ClockFitMethod {
  kLeastSquares,  ///< Huber's M-estimator, for jitter to both sides
  kEnvelope       ///< the lower envelope, for delays, which are never negative
};

/// The clock fits of all cameras and the method that was chosen.
struct ClockFits {
  std::vector<ClockFit> cameras;
  ClockFitMethod method = ClockFitMethod::kLeastSquares;
  /// Standard error of a period from a quarter of the frames, pooled over cameras, in ppm. The
  /// method is chosen by it. 0 if there are too few frames.
  double least_squares_ppm = 0, envelope_ppm = 0;
};

struct ClockFitOptions {
  bool choose_method = true;  ///< false: least squares
  bool share_periods = true;  ///< shrink the periods of a group towards their mean
};

/// Returns the clock fits of all cameras. `group[c]` identifies the clock that stamps camera c (any
/// number); a step that the group's cameras share is a step of that clock. `times[c]`: increasing,
/// in ns since a common time near them.
ClockFits fit_clocks(const std::vector<std::vector<double>>& times, const std::vector<int>& group,
                     const ClockFitOptions& options = {});

}  // namespace raystage::store
