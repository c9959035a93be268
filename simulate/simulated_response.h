// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "rig/photometric_model.h"
#include "simulate/simulation_options.h"

namespace raystage::simulate {

/// Returns the true photometric response of camera `index`: the calibration that corrects its
/// simulated colour errors.
schemas::PhotometricResponse simulated_response(const SimulationOptions& options,
                                                std::uint64_t index);

}  // namespace raystage::simulate
