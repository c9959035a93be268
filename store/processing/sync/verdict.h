// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "store/processing/sync/flash.h"
#include "store/processing/sync/resync.h"

namespace raystage {

/// What resynchronisation found, in plain sentences: the rate, clocks that stepped, what was lost,
/// what is odd. The first says how the array runs; each of the others names something to know.
std::vector<std::string> verdict_of(const Resync& resync, const std::optional<FlashOffsets>& flash);

/// Everything as JSON: rate, ticks, statistics, each camera's clock, losses and outliers, steps,
/// flashes, the verdict. Times in ns since the take's epoch unless the key says otherwise.
std::string json_of(const Resync& resync, const std::optional<FlashOffsets>& flash);

/// One self-contained page: the verdict, charts (inline SVG), a table of cameras. Needs nothing
/// from elsewhere and runs no script. `title` is the take's name.
std::string report_html(const Resync& resync, const std::optional<FlashOffsets>& flash,
                        std::string_view title);

}  // namespace raystage
