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

/// One task of a job, on the node that carries it out.
struct TaskRequest {
  JobFolder folder;
  FarmStage stage = FarmStage::kRender;
  int index = 0;  ///< within the stage
  int round = 1;
  std::string node = {};  ///< the scheduler's name of this node; empty: node_name()
  std::vector<PathMappingRule> paths = {};  ///< on top of those that the job was written with
  /// Seconds that the verification looks for frames that another host has written.
  double timeout_seconds = 60;
  std::function<void(double)> progress = [](double) {};
  std::function<void(std::string_view)> say = [](std::string_view) {};
};

/// Carries a task out: records the attempt, checks the node, runs the command with its output in
/// JOB/logs, and records how it ended. A node at fault is excluded from the job, as is one on which
/// two tasks failed. kSuccess only where everything that was asked for exists. Throws Error where
/// the job itself cannot be read or recorded.
ExitCode run_task(const TaskRequest& request, const std::stop_token& stop);

/// The job as a node with these path rules sees it, and its shot (JOB/shot.json, or a copy of it
/// with its paths mapped).
struct MappedJob {
  FarmJobDocument job;
  std::filesystem::path shot;
};
MappedJob read_mapped_job(const JobFolder& folder, std::span<const PathMappingRule> rules);
/// The same as this host sees it, which may be the submitting host.
MappedJob read_local_job(const JobFolder& folder);

}  // namespace raystage::farm
