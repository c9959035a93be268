// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <vector>

#include "store/processing/sync/clock_fit.h"

namespace raystage::store {

/// Line fits for fit_clocks(). The functions read `fit.slots` and `fit.phase_steps` and write the
/// lattice, the sizes of steps and the residuals.

/// Time stamps (ns) and clock fit of one camera.
struct CameraLine {
  std::span<const double> times;
  ClockFit* fit = nullptr;
};

/// Returns the number of steps that the group's cameras share: the highest number plus one.
int group_step_count(std::span<const CameraLine> group);

/// Fits a group of cameras by weighted least squares. Unknowns: a line and the own steps of each
/// camera, and the steps of the group (by the Schur complement). Weights are Huber's, by each
/// camera's jitter; outliers have weight 0.
void fit_least_squares(std::span<const CameraLine> group);

/// Computes residuals, jitter, outlier limits and `regular` from the lattice and phase steps.
void update_residuals(const CameraLine& camera);

/// Returns the unweighted least-squares line through (slot, time) pairs.
Lattice least_squares_line(std::span<const double> slots, std::span<const double> times);

}  // namespace raystage::store
