// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "ingest/simulated/array.h"
#include "ingest/simulated/schedule.h"
#include "ingest/simulated/settings.h"

namespace raystage {

/// TAKE/truth.json, schema "raystage/simulation-truth/1": settings, true calibration, true times
/// and clock errors. Layout in docs/simulation.md.
std::string truth_text(const SimulationSettings& settings, const SimulatedArray& array,
                       const Schedule& schedule);

}  // namespace raystage
