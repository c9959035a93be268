// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "farm/attempts.h"
#include "schemas/farm_job_document.h"

namespace raystage::farm {

/// What a job takes, measured by its tasks. Times are wall-clock seconds of a slot, which runs one
/// task of `threads` threads at a time.
struct JobCosts {
  int frames = 1, chunks = 1, instants = 0;
  int threads = 1;                   ///< of a task
  double solve_s = 0;                ///< of an instant, stage prepare
  double frame_s = 0;                ///< of a frame, of those under way at once
  double frame_cpu_s = 0;            ///< processor time of a frame, the task's other work included
  double task_s = 0;                 ///< of a task besides its frames: its start, and its records
  RenderStageCosts stages = {};      ///< of a frame, mean; frames 0: the records lack them
  std::optional<double> gap_s = {};  ///< from the end of a task to the next on the same node, mean
  double frame_read_bytes = 0;       ///< JPEG data that a frame needs
  double frame_write_bytes = 0;      ///< its files
  double verify_s = 0;               ///< wall-clock, of a frame
  double submit_s = 0;               ///< wall-clock, of the job
};

/// The site. Latency and throughput of the scheduler are different things: how long one task waits
/// although a slot is free, and how many tasks it can start in a second.
struct SiteParameters {
  int cores_per_node = 2;
  double storage_read_bytes_per_s = 1e9, storage_write_bytes_per_s = 1e9;  ///< shared by all nodes
  double start_latency_s = 1;
  double starts_per_s = 50;
};

/// What keeps a job from being faster on so many nodes.
enum class CostLimit {
  kProcessors,
  kTooFewTasks,
  kStorageRead,
  kStorageWrite,
  kScheduler,
  kSerial
};
std::string_view cost_limit_name(CostLimit limit);

struct ScalingPrediction {
  int nodes = 1;
  double seconds = 0;
  double prepare_s = 0, render_s = 0, serial_s = 0;  ///< submission and verification are serial
  CostLimit limit = CostLimit::kProcessors;          ///< of what takes longest
  double efficiency = 1;                             ///< against one node, times nodes
};

/// Each stage takes as long as its slowest resource: processors in whole waves of tasks, the shared
/// storage, or the scheduler. Stages follow each other.
ScalingPrediction predict_scaling(const JobCosts& job, const SiteParameters& site, int nodes);

/// The costs of a job that has run, from its records: needs a chunk that is done. None: there is
/// none.
std::optional<JobCosts> measured_costs(const FarmJobDocument& job, const TaskAttempts& attempts);

/// A table for people, and a page with the curve of efficiency over nodes.
std::string cost_text(const JobCosts& job, const SiteParameters& site, std::span<const int> nodes);
std::string cost_page(const JobCosts& job, const SiteParameters& site, std::span<const int> nodes,
                      std::string_view title);

}  // namespace raystage::farm
