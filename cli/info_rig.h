// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <vector>

#include "base/error.h"
#include "rig/lens_summary.h"
#include "store/shutter_summary.h"

namespace raystage::cli {

/// Returns the lenses of a rig for `--json`.
nlohmann::ordered_json lenses_as_json(const std::vector<rig::LensSummary>& lenses);

/// Returns the shutters of a rig for `--json`.
nlohmann::ordered_json shutters_as_json(const store::ShutterSummary& shutters);

/// Prints the contents of a rig.json without a take. Throws Error (bad input) as the document does.
ExitCode info_of_rig(const std::filesystem::path& file, bool json);

}  // namespace raystage::cli
