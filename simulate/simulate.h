// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <stop_token>
#include <string>

#include "base/run_status.h"
#include "simulate/simulation_options.h"

namespace raystage::simulate {

/// Counts of the data that a simulation wrote.
struct SimulationReport {
  RunStatus status = RunStatus::kNotRun;
  int cameras = 0;
  int frames_stored = 0, frames_missing = 0;
  int truth_views = 0;
};

/// Renders the scene for every camera at its own exposure times and writes the take: archives,
/// take.json, rig.json, truth.json (docs/simulation.md), views.json with images in truth/, and
/// shot.json. The bytes depend on the settings only, not on the number of threads (those of the
/// caller's TBB arena). `created_by`: program and version. `progress` gets 0 to 1, from any thread.
/// If it throws Error (bad input for settings; failed for the disk or `stop`), no folder remains.
SimulationReport simulate(const SimulationOptions& options, const std::filesystem::path& folder,
                          const std::string& created_by,
                          const std::function<void(double)>& progress = {},
                          std::stop_token stop = {});

}  // namespace raystage::simulate
