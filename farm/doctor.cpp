// SPDX-License-Identifier: Apache-2.0
#include "farm/doctor.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <thread>

#include "base/atomic_file.h"
#include "base/child_process.h"
#include "base/resources.h"
#include "base/stopwatch.h"
#include "compose/sequence_name.h"
#include "farm/node_checks.h"
#include "farm/slurm_queue.h"
#include "farm/slurm_scripts.h"
#include "raystage_version.h"
#include "render/common/simd_level.h"
#include "schemas/json_text.h"

namespace raystage::farm {
namespace {

namespace fs = std::filesystem;

std::string doctor_script(const schemas::FarmJobDocument& job, const std::string& folder) {
  const std::string command_prefix = job.command_prefix.empty() ? "" : job.command_prefix + " ";
  // A node writes its answer to a file with its name. Without the job folder it cannot answer.
  return fmt::format(
      "#!/bin/sh\n# Checks whether one node can run tasks of farm job {}.\n"
      "#SBATCH --nodes=1 --ntasks=1 --cpus-per-task=1 --mem=300M --time=5\n"
      "#SBATCH --export=NONE --output=/dev/null --job-name={}\n"
      "cd {} || exit 1\n"
      "{}{} farm task \"$PWD\" doctor --node \"$SLURMD_NODENAME\" "
      ">\"{}/$SLURMD_NODENAME.new\" 2>\"{}/$SLURMD_NODENAME.said\" ||\n"
      "  cat \"{}/$SLURMD_NODENAME.said\" >>\"{}/$SLURMD_NODENAME.new\"\n"
      "mv \"{}/$SLURMD_NODENAME.new\" \"{}/$SLURMD_NODENAME\"\n",
      job.id, slurm_job_name(job, "doctor"), shell_quote(job.folder), command_prefix,
      shell_quote(job.program), folder, folder, folder, folder, folder, folder);
}

NodeReport fault_report(const std::string& node, const std::string& why) {
  NodeReport report;
  report.node = node;
  report.fault = why;
  return report;
}

bool is_usable(const std::string& state) {
  return state.starts_with("idle") || state.starts_with("mixed") || state.starts_with("alloc") ||
         state.starts_with("comp");
}

/// Returns why the node is too small for a task of stage render, or nothing.
std::string size_fault(const schemas::FarmJobDocument& job, const SlurmNode& node) {
  const schemas::FarmResources& needed = job.of(schemas::FarmStage::kRender);
  const int mebibytes = slurm_megabytes(needed, 1);
  if (node.processors < needed.threads) {
    return fmt::format("Slurm offers {} processors there, a task needs {}", node.processors,
                       needed.threads);
  }
  if (node.memory_mebibytes < mebibytes) {
    return fmt::format("Slurm offers {:.0f} MiB there, a task needs {} MiB", node.memory_mebibytes,
                       mebibytes);
  }
  return "";
}

/// Returns the state of a Slurm job, e.g. "PENDING"; nothing if Slurm does not have it, and
/// "UNKNOWN" if Slurm does not answer.
std::string slurm_state_of(const std::string& id) {
  const ChildResult result = run_child({"squeue", "-h", "-j", id, "-o", "%T"});
  if (result.exit_code == 0) return result.out.substr(0, result.out.find('\n'));
  return result.out.find("Invalid job id") == std::string::npos ? "UNKNOWN" : "";
}

/// Words why a node did not answer, from the state of its check in Slurm.
std::string describe_silence(const std::string& slurm_state, double seconds) {
  // A check that ended without an answer: Slurm keeps it for a while, then forgets it.
  if (slurm_state.empty() || slurm_state == "COMPLETED" || slurm_state == "FAILED") {
    return fmt::format(
        "no answer within {:.0f} s, and the check is over in Slurm: the job folder does not exist, "
        "or the command of a task cannot be started",
        seconds);
  }
  return fmt::format(
      "no answer within {:.0f} s; Slurm reports its check as {}: the node is slow, its "
      "login shell waits (Slurm reads the environment of a task from it), the job folder does not "
      "exist there, or the command of a task cannot be started",
      seconds, slurm_state);
}

std::vector<NodeReport> check_slurm_nodes(const JobFolder& folder,
                                          const schemas::FarmJobDocument& job,
                                          const std::vector<std::string>& wanted,
                                          double timeout_seconds, const std::stop_token& stop) {
  std::map<std::string, NodeReport> reports;
  std::map<std::string, std::string> checks, sizes;  // by node: id of the check; fault of its size
  const std::string answers = fmt::format("doctor.{:x}", static_cast<std::uint64_t>(utc_now()));
  create_folder(folder.path() / answers);
  write_file_atomically(folder.path() / "doctor.sbatch", doctor_script(job, answers));
  for (const SlurmNode& node :
       slurm_nodes(sbatch_partition(job.of(schemas::FarmStage::kRender).options))) {
    if (!wanted.empty() && std::ranges::find(wanted, node.name) == wanted.end()) continue;
    sizes[node.name] = size_fault(job, node);
    if (!is_usable(node.state)) {
      reports[node.name] = fault_report(node.name, "Slurm: " + node.state);
      continue;
    }
    std::vector<std::string> command{"sbatch", "--parsable", "--nodelist=" + node.name};
    // The doctor uses the partition and account of the tasks.
    for (const std::string& option : job.of(schemas::FarmStage::kRender).options)
      command.push_back(option);
    command.push_back((folder.path() / "doctor.sbatch").string());
    const ChildResult result = run_child(command);
    if (result.exit_code != 0) {
      reports[node.name] = fault_report(node.name, "Slurm rejected a task for this node: " +
                                                       result.out.substr(0, result.out.find('\n')));
    } else {
      checks[node.name] = result.out.substr(0, result.out.find_first_of(";\n"));
    }
  }
  for (const std::string& node : wanted) {
    if (!reports.contains(node) && !checks.contains(node)) {
      reports[node] = fault_report(node, "Slurm has no node of this name");
    }
  }
  const Stopwatch watch;
  while (!checks.empty() && !stop.stop_requested()) {
    std::erase_if(checks, [&](const auto& check) {
      const std::string& node = check.first;
      const auto text = read_record(folder.contained(folder.path() / answers / node));
      if (!text) return false;
      try {
        reports[node] = parse_node_report(*text, node);
        reports[node].node = node;
        if (reports[node].fault.empty()) reports[node].fault = sizes[node];
      } catch (const Error&) {
        reports[node] = fault_report(node, text->substr(0, text->find('\n')));
      }
      return true;
    });
    if (watch.seconds() > timeout_seconds) break;
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
  }
  for (const auto& [node, id] : checks) {
    const std::string state = slurm_state_of(id);
    if (state == "PENDING") {
      reports[node] = fault_report(node, "");
      reports[node].is_pending = true;
    } else {
      reports[node] = fault_report(node, describe_silence(state, timeout_seconds));
    }
  }
  if (!checks.empty()) run_child({"scancel", "--quiet", "--name=" + slurm_job_name(job, "doctor")});
  std::error_code ignored;
  fs::remove_all(folder.path() / answers, ignored);
  std::vector<NodeReport> result;
  for (auto& [node, report] : reports) result.push_back(std::move(report));
  return result;
}

}  // namespace

NodeReport check_node(const schemas::FarmJobDocument& job, const fs::path& folder,
                      const std::string& node) {
  NodeReport report;
  report.node = node.empty() ? node_name() : node;
  report.answered = true;
  report.fault = node_fault(job, folder).value_or("");
  report.version = RAYSTAGE_VERSION;
  report.build = build_id();
  report.simd = render::simd_level_name(render::best_simd_level());
  report.threads = available_threads();
  report.memory_bytes = static_cast<double>(available_memory());
  std::error_code error;
  report.can_read_shot = fs::is_directory(job.shot_folder, error);
  const fs::path output = compose::SequenceName(job.output).folder();
  report.can_write_output = fs::is_directory(output, error);
  const fs::space_info space = fs::space(output, error);
  if (!error) report.free_bytes = static_cast<double>(space.available);
  return report;
}

std::string format_node_report(const NodeReport& report) {
  return nlohmann::ordered_json{{"node", report.node},
                                {"fault", report.fault},
                                {"version", report.version},
                                {"build", report.build},
                                {"simd", report.simd},
                                {"threads", report.threads},
                                {"memory_bytes", report.memory_bytes},
                                {"free_bytes", report.free_bytes},
                                {"sees_shot", report.can_read_shot},
                                {"sees_output", report.can_write_output}}
             .dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace) +
         "\n";
}

NodeReport parse_node_report(std::string_view text, std::string_view name) {
  const nlohmann::json json = schemas::parse_json(text, name);
  const auto value = [&](const char* key, auto otherwise) {
    using T = decltype(otherwise);
    try {
      return json.is_object() ? json.value(key, otherwise) : otherwise;
    } catch (const nlohmann::json::exception&) {
      throw schemas::json_value_error(name, fmt::format("/{}", key), "the node's answer is damaged",
                                      "Run the check again");
    }
    return T{};
  };
  NodeReport report;
  report.node = value("node", std::string());
  if (report.node.empty())
    throw schemas::json_value_error(name, "/node", "the answer names no node",
                                    "Run the check again");
  report.answered = true;
  report.fault = value("fault", std::string());
  report.version = value("version", std::string());
  report.build = value("build", std::string());
  report.simd = value("simd", std::string());
  report.threads = value("threads", 0);
  report.memory_bytes = value("memory_bytes", 0.0);
  report.free_bytes = value("free_bytes", 0.0);
  report.can_read_shot = value("sees_shot", false);
  report.can_write_output = value("sees_output", false);
  return report;
}

std::vector<NodeReport> check_nodes(const JobFolder& folder, const std::vector<std::string>& nodes,
                                    double timeout_seconds, const std::stop_token& stop) {
  const schemas::FarmJobDocument job = folder.job();
  if (job.engine != schemas::FarmJobDocument::Engine::kSlurm)
    return {check_node(job, folder.path())};
  return check_slurm_nodes(folder, job, nodes, timeout_seconds, stop);
}

std::string doctor_text(const std::vector<NodeReport>& reports) {
  std::string text =
      fmt::format("{:<16} {:<9} {:<17} {:<7} {:>7} {:>10} {:>12}  {}\n", "node", "version", "build",
                  "simd", "threads", "memory", "output free", "verdict");
  for (const NodeReport& report : reports) {
    if (!report.answered) {
      const std::string verdict = report.is_pending ? "not checked: busy" : report.fault;
      text += fmt::format("{:<16} {:<9} {:<17} {:<7} {:>7} {:>10} {:>12}  {}\n", report.node, "-",
                          "-", "-", "-", "-", "-", verdict);
      continue;
    }
    text += fmt::format("{:<16} {:<9} {:<17} {:<7} {:>7} {:>7.1f} GB {:>9.1f} GB  {}\n",
                        report.node, report.version, report.build, report.simd, report.threads,
                        report.memory_bytes * 1e-9, report.free_bytes * 1e-9,
                        report.fault.empty() ? "ready" : report.fault);
  }
  return text;
}

}  // namespace raystage::farm
