// SPDX-License-Identifier: Apache-2.0
#include "farm/slurm_queue.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <set>
#include <sstream>

#include "base/child_process.h"
#include "base/error.h"
#include "base/number_text.h"
#include "farm/slurm_scripts.h"

namespace raystage::farm {
namespace {

constexpr double kPatience = 20;  // seconds; Slurm's own MessageTimeout is 10
constexpr std::array<std::string_view, 5> kStages{"prepare", "render", "verify", "preview",
                                                  "start"};

ChildResult ask(const std::vector<std::string>& command) {
  ChildOptions options;
  options.timeout_seconds = kPatience;
  options.max_output_bytes = std::size_t{1} << 28;  // half a kilobyte per task of large arrays
  return run_child(command, options);
}

/// Returns a command's output as one line.
std::string one_line(const std::string& text) {
  constexpr std::size_t kLongest = 600;
  std::string line = text.substr(0, kLongest);
  while (!line.empty() && line.back() == '\n') line.pop_back();
  std::ranges::replace(line, '\n', ' ');
  return line;
}

Error unavailable(const ChildResult& result, const std::string& command) {
  return Error::failed("Slurm does not answer: " + one_line(result.out), command,
                       "Check `scontrol ping` and SLURM_CONF, or use engine local");
}

std::vector<std::string> words_of(const std::string& line, char separator) {
  std::vector<std::string> words;
  std::istringstream in(line);
  for (std::string word; std::getline(in, word, separator);) words.push_back(word);
  return words;
}

/// Returns the lines that sinfo prints about a partition; empty: about all.
std::vector<std::string> sinfo(std::vector<std::string> command, const std::string& partition) {
  command.insert(command.begin(), {"sinfo", "-h"});
  if (!partition.empty()) command.push_back("--partition=" + partition);
  const ChildResult result = ask(command);
  if (result.exit_code != 0) throw unavailable(result, "sinfo");
  return words_of(result.out, '\n');
}

}  // namespace

std::optional<std::map<std::string, SlurmTask>> slurm_tasks(const schemas::FarmJobDocument& job) {
  std::string names;
  for (const std::string_view stage : kStages) {
    names += (names.empty() ? "" : ",") + slurm_job_name(job, stage);
  }
  ChildResult result;
  try {
    // -r: one line per task ("123_4" or "123"), never several tasks as "123_[4-7%2]".
    result = ask({"squeue", "-h", "-r", "--states=all", "--name=" + names, "-O",
                  "JobArrayID:60|,Name:250|,State:30|,Reason:60|,NodeList:250|,RestartCnt:12|"});
  } catch (const Error&) {
    return std::nullopt;  // this host has no squeue
  }
  if (result.exit_code != 0) return std::nullopt;
  std::map<std::string, SlurmTask> tasks;
  for (const std::string& line : words_of(result.out, '\n')) {
    std::vector<std::string> words = words_of(line, '|');
    if (words.size() < 6) continue;
    for (std::string& word : words) {
      const std::size_t begin = word.find_first_not_of(' ');
      const std::size_t end = word.find_last_not_of(' ');
      word = begin == std::string::npos ? "" : word.substr(begin, end - begin + 1);
    }
    SlurmTask task;
    task.task = words[0];
    const std::size_t dot = words[1].rfind('.');
    task.stage = dot == std::string::npos ? words[1] : words[1].substr(dot + 1);
    task.state = words[2];
    task.reason = words[3] == "None" ? "" : words[3];
    task.node = words[4];
    task.restarts = number_at_start(words[5]);
    tasks[task.task] = std::move(task);
  }
  return tasks;
}

int slurm_max_array() {
  const ChildResult result = ask({"scontrol", "show", "config"});
  const std::size_t at = result.out.find("MaxArraySize");
  if (result.exit_code != 0 || at == std::string::npos) {
    throw unavailable(result, "scontrol show config");
  }
  const std::size_t digit = result.out.find_first_of("0123456789", at);
  const int size =
      digit == std::string::npos ? 0 : number_at_start(std::string_view(result.out).substr(digit));
  if (size < 1) {
    throw Error::failed("Slurm allows no arrays (MaxArraySize 0)", "scontrol show config",
                        "Ask the cluster's administrator, or use engine local");
  }
  return size;
}

std::vector<SlurmNode> slurm_nodes(const std::string& partition) {
  std::map<std::string, SlurmNode> by_name;  // a node may be in several partitions
  for (const std::string& line : sinfo({"-N", "-o", "%N|%T|%c|%m"}, partition)) {
    const std::vector<std::string> words = words_of(line, '|');
    if (words.size() != 4) continue;
    by_name[words[0]] = {words[0], words[1], number_at_start(words[2]),
                         number_at_start<double>(words[3])};
  }
  std::vector<SlurmNode> nodes;
  for (auto& [name, node] : by_name) nodes.push_back(std::move(node));
  return nodes;
}

std::vector<std::string> expand_node_list(const std::string& list) {
  const ChildResult result = ask({"scontrol", "show", "hostnames", list});
  if (result.exit_code != 0) throw unavailable(result, "scontrol show hostnames");
  std::vector<std::string> nodes = words_of(result.out, '\n');
  std::erase(nodes, "");
  std::set<std::string> known;
  for (const SlurmNode& node : slurm_nodes("")) known.insert(node.name);
  for (const std::string& node : nodes) {
    if (known.contains(node)) continue;
    throw Error::bad_input("there is no node " + node, "nodes", "Use names that sinfo -N prints");
  }
  return nodes;
}

std::optional<int> slurm_max_minutes(const std::string& partition) {
  for (const std::string& line : sinfo({"-o", "%P|%l"}, partition)) {
    const std::vector<std::string> words = words_of(line, '|');
    // The default partition is marked with a star.
    if (words.size() != 2 || (partition.empty() && !words[0].ends_with('*'))) continue;
    return parse_slurm_minutes(words[1]);
  }
  return std::nullopt;
}

std::optional<int> parse_slurm_minutes(std::string_view text) {
  // [DAYS-]HOURS:MINUTES:SECONDS or MINUTES:SECONDS, otherwise a word such as "infinite".
  int days = 0;
  if (const std::size_t dash = text.find('-'); dash != std::string_view::npos) {
    if (std::from_chars(text.data(), text.data() + dash, days).ec != std::errc()) return {};
    text.remove_prefix(dash + 1);
  }
  std::vector<int> parts;
  for (const std::string& word : words_of(std::string(text), ':')) {
    int part = 0;
    if (std::from_chars(word.data(), word.data() + word.size(), part).ec != std::errc()) return {};
    parts.push_back(part);
  }
  if (parts.size() < 2 || parts.size() > 3) return std::nullopt;
  const int hours = parts.size() == 3 ? parts[0] : 0;
  return (days * 24 + hours) * 60 + parts[parts.size() - 2];
}

std::string sbatch_option_value(std::span<const std::string> options, std::string_view name,
                                std::string_view short_name) {
  std::string value;
  for (const std::string& option : options) {
    if (option.starts_with(name)) value = option.substr(name.size());
    if (option.starts_with(short_name)) value = option.substr(short_name.size());
  }
  return value;
}

std::string sbatch_partition(std::span<const std::string> sbatch_options) {
  return sbatch_option_value(sbatch_options, "--partition=", "-p");
}

void test_batch_scripts(const JobFolder& folder, const schemas::FarmJobDocument& job) {
  for (const schemas::FarmStage stage : schemas::kFarmStages) {
    if (stage == schemas::FarmStage::kPrepare && job.instants.empty()) continue;
    if (stage == schemas::FarmStage::kPreview && !job.preview) continue;
    const std::string script = fmt::format("{}.sbatch", schemas::farm_stage_name(stage));
    const ChildResult result =
        ask({"sbatch", "--test-only", (folder.path() / script).string(), "1", "0"});
    const bool is_down = result.out.find("Required node not available") != std::string::npos;
    if (result.exit_code == 0 || is_down) continue;
    throw Error::bad_input(
        fmt::format("Slurm would reject a task of stage {} ({} threads, {} MiB): {}",
                    schemas::farm_stage_name(stage), job.of(stage).threads,
                    slurm_megabytes(job.of(stage), 1), one_line(result.out)),
        "sbatch", "Correct the named option, or give tasks fewer threads or less memory");
  }
}

void run_queue_script(const JobFolder& folder, const std::string& script) {
  const ChildResult result = run_child({"sh", (folder.path() / script).string()});
  if (result.exit_code == 0) return;
  throw Error::failed("sbatch rejected a task: " + one_line(result.out),
                      (folder.path() / script).string(),
                      "Correct the named option and submit again");
}

void cancel_slurm_job(const schemas::FarmJobDocument& job) {
  for (const std::string_view stage : kStages) {
    const ChildResult result = ask({"scancel", "--quiet", "--name=" + slurm_job_name(job, stage)});
    if (result.exit_code != 0) throw unavailable(result, "scancel");
  }
}

}  // namespace raystage::farm
