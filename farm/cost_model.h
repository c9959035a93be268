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

/// The measured costs of a job's tasks. Times are wall-clock seconds of a slot, which runs one task
/// of `threads` threads at a time.
struct JobCosts {
  int frames = 1, chunks = 1, instants = 0;
  int threads = 1;                        ///< per task
  double solve_s = 0;                     ///< per instant, in stage prepare
  double frame_s = 0;                     ///< per frame, with frames rendered concurrently
  double frame_cpu_s = 0;                 ///< CPU time per frame, the task's other work included
  double task_s = 0;                      ///< overhead per task: start and records
  schemas::RenderStageCosts stages = {};  ///< mean per frame; frames 0: not in the records
  std::optional<double> gap_s = {};       ///< mean time between two tasks on the same node
  double frame_read_bytes = 0;            ///< JPEG data read per frame
  double frame_write_bytes = 0;           ///< size of the files of a frame
  double verify_s = 0;                    ///< wall-clock time per frame
};

/// The parameters of a cluster. `start_latency_s` is how long a task waits although a slot is free;
/// `starts_per_s` is how many tasks the scheduler can start in a second.
struct SiteParameters {
  int cores_per_node = 2;
  double storage_read_bytes_per_s = 1e9, storage_write_bytes_per_s = 1e9;  ///< shared by all nodes
  double start_latency_s = 1;
  double starts_per_s = 50;
};

/// The resource that limits a job's speed on a given number of nodes.
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
  CostLimit limit = CostLimit::kProcessors;          ///< of the longest stage
  double efficiency = 1;                             ///< speed-up over one node, divided by nodes
};

/// Predicts the time of a job on `nodes` nodes. Each stage takes as long as its slowest resource:
/// processors in complete waves of tasks, the shared storage, or the scheduler. Stages run in
/// sequence.
ScalingPrediction predict_scaling(const JobCosts& job, const SiteParameters& site, int nodes);

/// Returns the costs of a job from its records, or nothing if no chunk is done.
std::optional<JobCosts> measured_costs(const schemas::FarmJobDocument& job,
                                       const TaskAttempts& attempts);

/// Returns the prediction as a text table.
std::string cost_text(const JobCosts& job, const SiteParameters& site, std::span<const int> nodes);

}  // namespace raystage::farm
