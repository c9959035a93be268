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
  std::function<void(std::string_view)> say = [](std::string_view) {};
};

/// Runs a job's newest round, and those that its verifications add, on this machine: the same tasks
/// as on a farm, one after the other. kSuccess only where every frame is whole and true; a stop
/// ends the job as "stopped".
ExitCode run_job_locally(const JobFolder& folder, const LocalOptions& options,
                         const std::stop_token& stop);

/// Whether the process that runs the job (engine local) lives; none: it runs on another host.
std::optional<bool> is_local_job_running(const FarmRound& round);

/// Stops the process that runs the job, if it lives on this host, and waits up to a minute for its
/// end. Throws Error (failed) where it does not end, or lives on another host.
void stop_local_job(const JobFolder& folder);

}  // namespace raystage::farm
