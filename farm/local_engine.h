// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <stop_token>
#include <string_view>

#include "base/error.h"
#include "farm/job_folder.h"

namespace raystage::farm {

struct LocalOptions {
  std::function<void(double)> progress = [](double) {};  ///< of the whole job
  std::function<void(std::string_view)> on_message = [](std::string_view) {};
};

/// Runs a job's newest round, and the rounds that its verifications add, on this machine. It runs
/// the same tasks as a farm, in sequence. Returns kSuccess only if every frame is complete and its
/// fingerprint matches. A stop request ends the job as "stopped".
ExitCode run_job_locally(const JobFolder& folder, const LocalOptions& options,
                         const std::stop_token& stop);

/// Returns whether the process that runs the job (engine local) is alive, or nothing if the job
/// runs on another host.
std::optional<bool> is_local_job_running(const schemas::FarmRound& round);

/// Stops the process that runs the job on this host, and waits up to a minute for its end. Throws
/// Error (failed) if it does not end, or runs on another host.
void stop_local_job(const JobFolder& folder);

}  // namespace raystage::farm
