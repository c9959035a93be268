// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string_view>

#include "schemas/recording_document.h"

namespace raystage::ingest {

/// Returns what disciplines the clock of this machine now: chrony (as `chronyc` reports), PTP (if
/// phc2sys runs), else the state that the kernel reports, else "unknown".
schemas::RecordingDocument::Clock query_clock_sync();

/// Parses the answer of `pmc ... 'GET CURRENT_DATA_SET'`. Returns the clock offset from the PTP
/// master in seconds, or nothing if the answer has no number of nanoseconds.
std::optional<double> parse_pmc_offset(std::string_view answer);

/// Parses the answer of `chronyc -c tracking` (comma separated). Returns "unknown" if it is not
/// such an answer or chrony has no reference.
schemas::RecordingDocument::Clock parse_chrony_tracking(std::string_view answer);

}  // namespace raystage::ingest
