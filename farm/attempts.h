// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <string>
#include <utility>
#include <vector>

#include "farm/job_folder.h"

namespace raystage::farm {

/// Records the start of an attempt in JOB/attempts under the next free number, and sets
/// `attempt.attempt` to it. Two processes never get the same number. Throws Error (failed) if the
/// disk refuses the record.
void record_attempt_start(const JobFolder& folder, schemas::FarmAttempt& attempt);

/// Overwrites the start record of `attempt` with its end. This works on a full disk, because the
/// start record has reserved the space. Throws Error (failed) if the disk refuses to overwrite.
void record_attempt_end(const JobFolder& folder, const schemas::FarmAttempt& attempt);

/// Attempts of each task (stage and index), in ascending order. An unreadable record counts as an
/// attempt without an end.
using TaskAttempts = std::map<std::pair<std::string, int>, std::vector<schemas::FarmAttempt>>;
TaskAttempts read_attempts(const JobFolder& folder);

/// Returns the name of the attempt's record and log, e.g. "render.0003.02".
std::string attempt_name(const schemas::FarmAttempt& attempt);
std::filesystem::path attempt_log(const JobFolder& folder, const schemas::FarmAttempt& attempt);

}  // namespace raystage::farm
