// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "store/processing/sync/flash.h"
#include "store/processing/sync/resync.h"

namespace raystage::store {

/// Returns the results of resynchronisation as sentences: the rate, clock steps, losses, outliers.
/// The first describes how the array runs; each of the others names one finding.
std::vector<std::string> resync_findings(const ResyncResult& resync,
                                         const std::optional<FlashOffsets>& flash);

/// Returns all results as JSON: rate, ticks, statistics, each camera's clock, losses and outliers,
/// steps, flashes, the findings. Times in ns since the take's epoch; other units are in the key.
std::string resync_report_json(const ResyncResult& resync,
                               const std::optional<FlashOffsets>& flash);

/// Returns a self-contained HTML page: the findings, charts (inline SVG), a table of cameras. It
/// loads no other file and runs no script. `title`: the take's name.
std::string resync_report_html(const ResyncResult& resync, const std::optional<FlashOffsets>& flash,
                               std::string_view title);

}  // namespace raystage::store
