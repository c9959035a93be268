// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "rig/photometric_model.h"
#include "simulate/simulation_settings.h"

namespace raystage {

/// How the colours of camera number `index` are wrong, as what mends them: the true calibration.
PhotometricResponse simulated_response(const SimulationSettings& settings, std::uint64_t index);

}  // namespace raystage
