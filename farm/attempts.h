// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <string>
#include <utility>
#include <vector>

#include "farm/job_folder.h"

namespace raystage::farm {

/// Records the start of an attempt in JOB/attempts under the next free number, which it sets. Two
/// processes never get the same number. Throws Error (failed) for the disk.
void record_attempt_start(const JobFolder& folder, FarmAttempt& attempt);

/// Writes `attempt` with its end over its start. A full disk is no obstacle: the start has reserved
/// the room. Throws Error (failed) where the disk refuses even that.
void record_attempt_end(const JobFolder& folder, const FarmAttempt& attempt);

/// Attempts by task (stage and index), in their order. A record that is unreadable counts as an
/// attempt without an end.
using TaskAttempts = std::map<std::pair<std::string, int>, std::vector<FarmAttempt>>;
TaskAttempts read_attempts(const JobFolder& folder);

/// "render.0003.02": of the attempt's record and log.
std::string attempt_name(const FarmAttempt& attempt);
std::filesystem::path attempt_log(const JobFolder& folder, const FarmAttempt& attempt);

}  // namespace raystage::farm
