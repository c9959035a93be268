// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <stop_token>
#include <string>
#include <vector>

#include "farm/job_folder.h"

namespace raystage::farm {

/// The result of a node's check of whether it can run a job's tasks.
struct NodeReport {
  std::string node;
  bool answered = false;
  bool is_pending = false;  ///< the check is still queued: nothing is known
  std::string fault;        ///< why the node is not usable or did not answer; empty: usable
  std::string version, build, simd;
  int threads = 0;
  double memory_bytes = 0;
  double free_bytes = 0;  ///< on the output disk
  bool can_read_shot = false, can_write_output = false;
};

/// Checks this machine. `node` is the scheduler's name of it; empty: its own name.
NodeReport check_node(const schemas::FarmJobDocument& job, const std::filesystem::path& folder,
                      const std::string& node = {});

/// Formats a report as one line of JSON, and parses it. parse_node_report() throws Error (bad
/// input).
std::string format_node_report(const NodeReport& report);
NodeReport parse_node_report(std::string_view text, std::string_view name);

/// Checks every node that Slurm could use for the job's tasks, by a task on each node; for engine
/// local, checks this machine. Nodes that are down are not checked. A node that does not answer
/// within the timeout is reported as such. A node whose check is still queued is reported as busy,
/// which is no fault. A node with fewer processors or less memory than a task needs has a fault.
std::vector<NodeReport> check_nodes(const JobFolder& folder, const std::vector<std::string>& nodes,
                                    double timeout_seconds, const std::stop_token& stop);

/// Returns the reports as a text table. Nodes whose build differs from the job's have a fault.
std::string doctor_text(const std::vector<NodeReport>& reports);

}  // namespace raystage::farm
