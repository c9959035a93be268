// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <stop_token>
#include <vector>

#include "farm/job_folder.h"

namespace raystage::farm {

/// Queues a round that was written (Slurm); the first one behind the job that it waits for, if any.
/// Throws Error (failed) where Slurm rejects it; the job has ended as failed then.
void queue_round(const JobFolder& folder, const FarmRound& round);

/// Writes and returns a round that continues a job. Without `frames`: the tasks of all frames that
/// are not whole on the disk; with them: these frames anew, whole or not. Pins the job's derived
/// data again. Throws Error (bad input) where the job is live, or nothing is to be done.
FarmRound write_retry_round(const JobFolder& folder, const std::optional<std::vector<int>>& frames,
                            const std::stop_token& stop);

}  // namespace raystage::farm
