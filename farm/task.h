// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <stop_token>
#include <string_view>
#include <vector>

#include "base/error.h"
#include "farm/job_folder.h"
#include "farm/path_map.h"

namespace raystage::farm {

/// One task of a job on the node that runs it.
struct TaskRequest {
  JobFolder folder;
  schemas::FarmStage stage = schemas::FarmStage::kRender;
  int index = 0;  ///< within the stage
  int round = 1;
  std::string node = {};  ///< the scheduler's name of this node; empty: node_name()
  std::vector<PathMappingRule> paths = {};  ///< on top of those that the job was written with
  /// Seconds that the verification waits for frames of another host to appear.
  double timeout_seconds = 60;
  std::function<void(double)> progress = [](double) {};
  std::function<void(std::string_view)> on_message = [](std::string_view) {};
};

/// Runs a task: records the attempt, checks the node, runs the command with its output in JOB/logs,
/// and records how it ended. Excludes a node with a fault, and one on which two tasks failed, from
/// the job. Returns kSuccess only if all requested files exist. Throws Error if the job cannot be
/// read or the attempt cannot be recorded.
ExitCode run_task(const TaskRequest& request, const std::stop_token& stop);

/// The job as a node with these path rules sees it, and its shot (JOB/shot.json, or a copy of it
/// with its paths mapped).
struct MappedJob {
  schemas::FarmJobDocument job;
  std::filesystem::path shot;
};
MappedJob read_mapped_job(const JobFolder& folder, std::span<const PathMappingRule> rules);
/// Reads the job with paths as this host sees them, which may be the submitting host.
MappedJob read_local_job(const JobFolder& folder);

}  // namespace raystage::farm
