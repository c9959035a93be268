// SPDX-License-Identifier: Apache-2.0
// Internal to calibrate/geometry: the steps of a solve after the initial poses.
#pragma once

#include "calibrate/geometry/solve.h"

namespace raystage::calibrate {

/// Returns the number of cameras with a pose.
int count_registered_cameras(const ArrayModel& model);

/// Runs bundle adjustments that refine more and more lens parameters, and classifies outliers after
/// each.
void run_bundle_adjustment_steps(ArrayModel& model, const SolveOptions& options,
                                 SolveReport& report);

/// Returns the state of the model under a name.
SolveReport::Step make_solve_step(const ArrayModel& model, std::string what);

}  // namespace raystage::calibrate
