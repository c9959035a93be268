// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "simulate/exposure_schedule.h"
#include "simulate/simulated_rig.h"
#include "simulate/simulation_options.h"

namespace raystage::simulate {

/// Returns the text of TAKE/truth.json (schema "raystage/simulation-truth/1"): settings, true
/// calibration, true times and clock errors. docs/simulation.md describes its layout.
std::string format_truth_document(const SimulationOptions& options, const SimulatedRig& array,
                                  const ExposureSchedule& schedule);

}  // namespace raystage::simulate
