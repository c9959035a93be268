// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "farm/job_folder.h"

namespace raystage::farm {

/// The state of one of a job's tasks as Slurm reports it.
struct SlurmTask {
  std::string stage;   ///< "prepare", "render", "verify", "preview" or "start"
  std::string task;    ///< "123_4" or "123"
  std::string state;   ///< PENDING, RUNNING, COMPLETED, ... as in squeue
  std::string reason;  ///< why it is pending
  std::string node;    ///< empty: not assigned yet
  int restarts = 0;
};

/// Returns all tasks of a job that Slurm still has, by name of the task, or nothing if the
/// controller does not answer.
std::optional<std::map<std::string, SlurmTask>> slurm_tasks(const schemas::FarmJobDocument& job);

/// Returns Slurm's MaxArraySize. Throws Error (failed) if Slurm does not answer.
int slurm_max_array();

/// A node of a partition.
struct SlurmNode {
  std::string name, state;
  int processors = 0;
  double memory_mebibytes = 0;
};
std::vector<SlurmNode> slurm_nodes(const std::string& partition);

/// Expands a node list as Slurm writes it, e.g. "n[1-4]". Throws Error (bad input) if it is not a
/// node list, Error (failed) if Slurm does not answer.
std::vector<std::string> expand_node_list(const std::string& list);

/// Returns a time of Slurm in minutes ("1-00:30:00" is 1470), or nothing for "infinite".
std::optional<int> parse_slurm_minutes(std::string_view text);
/// Returns the time limit of a partition (empty: the default one) in minutes, or nothing if it has
/// none.
std::optional<int> slurm_max_minutes(const std::string& partition);

/// Returns the value of the last such option, e.g. "fast" of "--partition=fast" or "-pfast"; empty
/// if there is none.
std::string sbatch_option_value(std::span<const std::string> options, std::string_view name,
                                std::string_view short_name);

/// Returns the partition that the options select; empty means the default partition.
std::string sbatch_partition(std::span<const std::string> sbatch_options);

/// Tests whether Slurm would accept the job's scripts, without queueing them (sbatch --test-only).
/// Throws Error (bad input) with Slurm's answer if it would not. Ignores nodes that are down.
void test_batch_scripts(const JobFolder& folder, const schemas::FarmJobDocument& job);

/// Runs a script of the job folder (round-N.sh). Throws Error (failed) with its output if it fails.
void run_queue_script(const JobFolder& folder, const std::string& script);

/// Cancels all queued and running tasks of the job.
void cancel_slurm_job(const schemas::FarmJobDocument& job);

}  // namespace raystage::farm
