// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "farm/job_folder.h"

namespace raystage::farm {

/// What a node answers when it is asked whether it can carry out a job's tasks.
struct NodeReport {
  std::string node;
  bool answered = false;
  bool is_pending = false;  ///< its question still waits in the queue: nothing is known
  std::string fault;        ///< empty: it can; where it did not answer, why
  std::string version, build, simd;
  int threads = 0;
  double memory_bytes = 0, free_bytes = 0;  ///< of the output disk
  bool can_read_shot = false, can_write_output = false;
};

/// This machine's answer, under its own name or the one that the scheduler has for it.
NodeReport check_node(const FarmJobDocument& job, const std::filesystem::path& folder,
                      const std::string& node = {});

/// As one line of JSON, and back. Throws Error (bad input).
std::string format_node_report(const NodeReport& report);
NodeReport parse_node_report(std::string_view text, std::string_view name);

/// Asks every node that Slurm could use for the job's tasks, by a task on each; of engine local
/// this machine. A node that is down is not asked; one that has not answered in time is reported
/// so, and one whose question is still queued as busy, which is no fault. A node that is smaller
/// than a task is at fault.
std::vector<NodeReport> check_nodes(const JobFolder& folder, const std::vector<std::string>& nodes,
                                    double timeout_seconds, const std::stop_token& stop);

/// A table for people. Nodes whose build differs from the job's are at fault.
std::string doctor_text(const std::vector<NodeReport>& reports);

}  // namespace raystage::farm
