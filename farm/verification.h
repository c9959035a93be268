// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <stop_token>
#include <vector>

#include "farm/job_folder.h"

namespace raystage::farm {

struct VerificationRequest {
  const JobFolder& folder;
  const FarmJobDocument& job;
  std::filesystem::path shot;
  int round = 1;
  double timeout_seconds = 60;  ///< as SequenceCheckSettings
  std::function<void(double)> progress;
};

/// The frames of the job that are not whole and true on the disk, sorted. Throws Error (bad input)
/// where the shot cannot be planned any more.
std::vector<int> find_incomplete_frames(const VerificationRequest& request,
                                        const std::stop_token& stop);

/// Checks every frame of the job against its fingerprint, then writes what follows: the next round,
/// or the end of the job (and lets go of what it had pinned). For Slurm, after-verify-N.sh queues
/// it. Done only where every frame is whole and true.
FarmAttempt::End verify_job(const VerificationRequest& request, const std::stop_token& stop);

/// Ends a job: writes ended.json and unpins what it had pinned.
void end_job(const JobFolder& folder, const FarmJobDocument& job, FarmEnd end);

}  // namespace raystage::farm
