// SPDX-License-Identifier: Apache-2.0
// Inside calibrate/geometry only: how a solve goes on once cameras have first poses.
#pragma once

#include "calibrate/geometry/solve.h"

namespace raystage {

/// Cameras that are found.
int count_registered_cameras(const ArrayModel& model);

/// Bundle adjustments, one after the other, with more and more of the lenses released and outliers
/// sorted out after each.
void run_bundle_adjustment_steps(ArrayModel& model, const SolveSettings& settings,
                                 SolveReport& report);

/// What the model is now, under a name.
SolveReport::Step make_solve_step(const ArrayModel& model, std::string what);

}  // namespace raystage
