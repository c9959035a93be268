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
  const schemas::FarmJobDocument& job;
  std::filesystem::path shot;
  int round = 1;
  double timeout_seconds = 60;  ///< as SequenceCheckOptions
  std::function<void(double)> progress;
};

/// Returns the frames of the job that are not complete or whose fingerprint differs, sorted. Throws
/// Error (bad input) if the shot can no longer be planned.
std::vector<int> find_incomplete_frames(const VerificationRequest& request,
                                        const std::stop_token& stop);

/// Checks every frame of the job against its fingerprint, then writes the next round or the end of
/// the job, and unpins its derived data at the end. For Slurm, after-verify-N.sh queues the round.
/// The result is "done" only if every frame is complete and its fingerprint matches.
schemas::FarmAttempt::End verify_job(const VerificationRequest& request,
                                     const std::stop_token& stop);

/// Ends a job: writes ended.json with the job's frames and this time, and unpins its derived data.
void end_job(const JobFolder& folder, const schemas::FarmJobDocument& job, schemas::FarmEnd end);

}  // namespace raystage::farm
