// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <stop_token>
#include <vector>

#include "farm/job_folder.h"

namespace raystage::farm {

/// Queues a written round with Slurm. The first round depends on the job that this job waits for,
/// if any. If Slurm rejects it, ends the job as failed and throws Error (failed).
void queue_round(const JobFolder& folder, const schemas::FarmRound& round);

/// Writes and returns a round that continues a job. Without `frames` it has the tasks of all frames
/// that are not complete on the disk. With `frames` it renders these frames again, complete or not.
/// Pins the job's derived data again. Throws Error (bad input) if the job is not over or nothing is
/// left to do.
schemas::FarmRound write_retry_round(const JobFolder& folder,
                                     const std::optional<std::vector<int>>& frames,
                                     const std::stop_token& stop);

}  // namespace raystage::farm
