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

/// What Slurm says of one of a job's tasks.
struct SlurmTask {
  std::string stage;   ///< "prepare", "render", "verify", "preview" or "start"
  std::string task;    ///< "123_4" or "123"
  std::string state;   ///< PENDING, RUNNING, COMPLETED, ... as squeue says
  std::string reason;  ///< of its waiting
  std::string node;    ///< empty: none yet
  int restarts = 0;
};

/// All tasks of a job that Slurm still knows, by name of the task; none: the controller does not
/// answer.
std::optional<std::map<std::string, SlurmTask>> slurm_tasks(const FarmJobDocument& job);

/// MaxArraySize. Throws Error (failed) where Slurm does not answer.
int slurm_max_array();

/// Nodes of the default partition, or of this one.
struct SlurmNode {
  std::string name, state;
  int processors = 0;
  double memory_mebibytes = 0;
};
std::vector<SlurmNode> slurm_nodes(const std::string& partition);

/// The nodes of a list as Slurm writes it, e.g. "n[1-4]". Throws Error (bad input) where it is
/// none, Error (failed) where Slurm does not answer.
std::vector<std::string> expand_node_list(const std::string& list);

/// "1-00:30:00" is 1470; none: "infinite".
std::optional<int> parse_slurm_minutes(std::string_view text);
/// The time limit of this partition, or the default one, minutes; none: there is none.
std::optional<int> slurm_max_minutes(const std::string& partition);

/// "fast" of "--partition=fast" or "-pfast", the last one given; empty: none.
std::string sbatch_option_value(std::span<const std::string> options, std::string_view name,
                                std::string_view short_name);

/// "fast" of "--partition=fast"; empty: the default partition.
std::string sbatch_partition(std::span<const std::string> sbatch_options);

/// Asks Slurm whether it would accept the job's scripts, without queueing them (sbatch
/// --test-only). Throws Error (bad input) with its answer where it would not; nodes that are down
/// at present are no reason.
void test_batch_scripts(const JobFolder& folder, const FarmJobDocument& job);

/// Runs a script of the job folder (round-N.sh). Throws Error (failed) with what it printed.
void run_queue_script(const JobFolder& folder, const std::string& script);

/// Cancels everything of the job that is queued or runs.
void cancel_slurm_job(const FarmJobDocument& job);

}  // namespace raystage::farm
