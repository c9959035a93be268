// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "base/time.h"
#include "store/processing/sync/lattice.h"

namespace raystage {

/// A jump of a camera's frames against its rhythm.
struct PhaseBreak {
  std::size_t first_frame = 0;  ///< the first after it
  double step = 0;              ///< ns; positive: later
  int group_step = -1;          ///< index into GroupFit::steps; -1: the camera's alone
};

/// The rhythm of one camera: stamp = lattice.at(slot) + breaks up to it + delay. Times in ns since
/// the time handed to fit_clocks().
struct ClockFit {
  Lattice lattice;                         ///< before the first break; period 0: too few frames
  std::vector<std::int64_t> slots;         ///< of each frame, increasing; kNoSlot: fits nowhere
  std::vector<PhaseBreak> breaks;          ///< by increasing frame
  std::vector<double> residual;            ///< of each frame, ns; 0 without slot
  double jitter = 0;                       ///< robust sigma of the residuals, ns
  double early_limit = 0, late_limit = 0;  ///< residuals beyond are outliers, ns
  double period_sigma = 0;                 ///< standard error of the period, ns
  /// Whether the camera holds one rate: false where more than a tenth of its frames are outliers,
  /// the jitter is above a fifth of the period, fewer than one slot in 20 has a frame, or the rate
  /// is above 10 kHz.
  bool regular = false;

  bool is_outlier(std::size_t frame) const {
    return slots[frame] == kNoSlot || residual[frame] < early_limit || residual[frame] > late_limit;
  }
  /// From the first frame with a slot to the last, both included; 0: none has one.
  double slots_spanned() const;
  /// Breaks before a frame, added up, ns: those of the group, or the camera's own.
  double group_shift(std::size_t frame) const;
  double own_shift(std::size_t frame) const;
};

/// What a line through stamps is fitted to.
enum class FitMethod {
  kLeastSquares,  ///< their middle (Huber's weights): jitter to both sides
  kEnvelope       ///< their lower edge: delays, never negative
};

struct ClockFits {
  std::vector<ClockFit> cameras;
  FitMethod method = FitMethod::kLeastSquares;
  /// Standard error of a period from a quarter of the frames, pooled over cameras, ppm: what the
  /// method was chosen by. 0 where there were too few frames to tell.
  double least_squares_ppm = 0, envelope_ppm = 0;
};

struct ClockFitSettings {
  bool choose_method = true;  ///< false: least squares
  bool share_periods = true;  ///< draw periods of a group together as far as they do not differ
};

/// Fits all cameras. `group[c]` says whose clock stamps camera c (any number); a step that the
/// group's cameras share is the clock's. `times[c]` in ns since some time near theirs, increasing.
ClockFits fit_clocks(const std::vector<std::vector<double>>& times, const std::vector<int>& group,
                     const ClockFitSettings& settings = {});

}  // namespace raystage
