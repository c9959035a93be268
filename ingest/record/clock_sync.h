// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string_view>

#include "schemas/recording_document.h"

namespace raystage {

/// What disciplines this machine's clock at this moment: chrony (asked by `chronyc`), PTP (a
/// running phc2sys or ptp4l), else what the kernel says, else "unknown".
RecordingDocument::Clock query_clock_sync();

/// How far the clock is from its PTP master, seconds: the answer of `pmc ... 'GET
/// CURRENT_DATA_SET'`. Empty where it holds no number of nanoseconds.
std::optional<double> parse_pmc_offset(std::string_view answer);

/// The answer of `chronyc -c tracking` (comma separated). "unknown" where it is none, or chrony has
/// no reference.
RecordingDocument::Clock parse_chrony_tracking(std::string_view answer);

}  // namespace raystage
