// SPDX-License-Identifier: Apache-2.0
// Inside rig/calibration only: how a solve goes on once cameras have first poses.
#pragma once

#include "rig/calibration/solve.h"

namespace raystage {

/// Cameras that are found.
int placed_in(const ArrayModel& model);

/// Bundle adjustments, one after the other, with more and more of the lenses released and outliers
/// sorted out after each.
void run_steps(ArrayModel& model, const SolveSettings& settings, SolveReport& report);

/// What the model is now, under a name.
SolveReport::Step step_of(const ArrayModel& model, std::string what);

}  // namespace raystage
