// SPDX-License-Identifier: Apache-2.0
#include "farm/slurm_scripts.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/atomic_file.h"
#include "farm/job_plan.h"
#include "farm/slurm_queue.h"
#include "farm/slurm_shell.h"

namespace raystage::farm {
namespace {

/// Memory outside of the renderer's budget: the program, its libraries, the allocator's reserve.
constexpr double kMemoryFactor = 1.1, kUnbudgetedBytes = 400e6;

/// Returns the nodes that the submission's options exclude, e.g. "n[1-5]"; empty: none.
std::string given_exclusion(const std::vector<std::string>& options) {
  return sbatch_option_value(options, "--exclude=", "-x");
}

std::string folder_lines(const schemas::FarmJobDocument& job, schemas::FarmStage stage) {
  return fmt::format("JOB={}\nJOB_ID={}\nEXCLUDED={}\n", shell_quote(job.folder),
                     shell_quote(job.id), shell_quote(given_exclusion(job.of(stage).options)));
}

bool is_on_all_nodes(const schemas::FarmJobDocument& job, schemas::FarmStage stage) {
  return job.distributed && stage == schemas::FarmStage::kRender;
}

/// Returns sbatch's options for the nodes of a task and the processes on each.
std::string node_options(const schemas::FarmJobDocument& job, schemas::FarmStage stage) {
  if (!is_on_all_nodes(job, stage)) return "--nodes=1 --ntasks=1";
  const std::vector<std::string>& nodes = job.distributed->nodes;
  return fmt::format("--nodes={} --ntasks-per-node=1 --nodelist={}", nodes.size(),
                     fmt::join(nodes, ","));
}

std::string task_command(const schemas::FarmJobDocument& job, schemas::FarmStage stage) {
  const std::string command_prefix = job.command_prefix.empty() ? "" : job.command_prefix + " ";
  return fmt::format(
      "{}{} farm task \"$JOB\" {} \"$INDEX\" --round \"$ROUND\" "
      "--node \"$SLURMD_NODENAME\"",
      command_prefix, shell_quote(job.program), schemas::farm_stage_name(stage));
}

std::string array_text(const std::vector<int>& indices) {
  std::string text;
  for (std::size_t begin = 0; begin < indices.size();) {
    std::size_t end = begin + 1;
    while (end < indices.size() && indices[end] == indices[end - 1] + 1) ++end;
    text += text.empty() ? "" : ",";
    text += end - begin == 1 ? fmt::format("{}", indices[begin])
                             : fmt::format("{}-{}", indices[begin], indices[end - 1]);
    begin = end;
  }
  return text;
}

/// Returns sbatch's options that a later round changes, with the nodes that it excludes.
std::string round_options(const schemas::FarmJobDocument& job, schemas::FarmStage stage,
                          const schemas::FarmRound& round) {
  std::string options;
  const schemas::FarmResources& resources = job.of(stage);
  if (round.memory_factor != 1) {
    options += fmt::format(" --mem={}M", slurm_megabytes(resources, round.memory_factor));
  }
  if (round.time_factor != 1 && resources.minutes) {
    const double minutes = std::ceil(*resources.minutes * round.time_factor);
    options += fmt::format(
        " --time={}",
        static_cast<int>(job.max_minutes ? std::min<double>(minutes, *job.max_minutes) : minutes));
  }
  if (!round.exclude.empty() && !is_on_all_nodes(job, stage)) options += " $exclude";
  return options;
}

/// A Slurm array: its name in JOB/slurm and its tasks of the stage.
struct QueuedArray {
  std::string name;
  ArrayPart part;
};

/// Returns the shell variable of the array's id, e.g. "prepare_1".
std::string variable_of(const QueuedArray& array) {
  return "prepare_" + array.name.substr(array.name.rfind('.') + 1);
}

/// Returns lines that set $exclude to the nodes that the round and the stage's options exclude: an
/// --exclude for sbatch replaces that of the script. If no node would remain, the round excludes
/// none.
std::string exclude_lines(const schemas::FarmJobDocument& job, schemas::FarmStage stage,
                          const schemas::FarmRound& round) {
  if (round.exclude.empty()) return "";
  const std::vector<std::string>& options = job.of(stage).options;
  std::string nodes = fmt::format("{}", fmt::join(round.exclude, ","));
  const std::string given = given_exclusion(options);
  if (!given.empty()) nodes += "," + given;
  const std::string partition = sbatch_partition(options);
  return fmt::format(
      "exclude={}\n"
      "partition={}\n"
      "sinfo -h -N -p \"$partition\" -t idle,mix,alloc,comp -o %N | sort -u >slurm/usable\n"
      "scontrol show hostnames {} | grep -vxFf - slurm/usable | grep -q . || exclude={}\n",
      shell_quote("--exclude=" + nodes),
      partition.empty() ? "$(sinfo -h -o %P | sed -n 's/[*]$//p' | head -n 1)"
                        : shell_quote(partition),
      shell_quote(nodes), given.empty() ? "" : shell_quote("--exclude=" + given));
}

std::vector<QueuedArray> prepare_arrays(const schemas::FarmJobDocument& job,
                                        const schemas::FarmRound& round) {
  std::vector<QueuedArray> arrays;
  for (ArrayPart& part : split_array(round.prepare, job.max_array_size)) {
    arrays.push_back(
        {fmt::format("prepare.{}.{}", round.round, arrays.size() + 1), std::move(part)});
  }
  return arrays;
}

/// Returns a dependency on tasks as shell text, e.g. "afterany:ID_4:ID_5". It names each task,
/// because a dependency on an array is never satisfied if one of its tasks was requeued. A chunk
/// derives missing data itself, so afterany suffices.
std::string dependency_on(const std::vector<int>& instants,
                          const std::vector<QueuedArray>& arrays) {
  std::string text = "afterany";
  for (const int instant : instants) {
    for (const QueuedArray& array : arrays) {
      const int index = instant - array.part.offset;
      if (!std::ranges::binary_search(array.part.indices, index)) continue;
      text += fmt::format(":${{{}}}_{}", variable_of(array), index);
    }
  }
  return text;
}

}  // namespace

std::string shell_quote(std::string_view text) {
  constexpr std::string_view kPlain =
      "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-./,:=+@%#";
  if (!text.empty() && text.front() != '#' && text.find_first_not_of(kPlain) == std::string::npos) {
    return std::string(text);
  }
  std::string quoted = "'";
  for (const char c : text) quoted += c == '\'' ? "'\\''" : std::string(1, c);
  return quoted + "'";
}

std::string slurm_job_name(const schemas::FarmJobDocument& job, std::string_view stage) {
  return fmt::format("{}.{}", job.id, stage);
}

int slurm_megabytes(const schemas::FarmResources& resources, double factor) {
  const double bytes = resources.memory_gb * 1e9 * factor * kMemoryFactor + kUnbudgetedBytes;
  return static_cast<int>(std::ceil(bytes / (1 << 20)));
}

std::string batch_script(const schemas::FarmJobDocument& job, schemas::FarmStage stage) {
  const schemas::FarmResources& resources = job.of(stage);
  std::string text = fmt::format(
      "#!/bin/sh\n"
      "# Stage {} of farm job {}. To queue by hand: sh round-1.sh, or one task:\n"
      "#   sbatch --array=0 {}.sbatch 1 0\n"
      "#SBATCH --job-name={}\n"
      "#SBATCH {} --cpus-per-task={}\n"
      "#SBATCH --mem={}M\n",
      schemas::farm_stage_name(stage), job.id, schemas::farm_stage_name(stage),
      slurm_job_name(job, schemas::farm_stage_name(stage)), node_options(job, stage),
      resources.threads, slurm_megabytes(resources, 1));
  if (resources.minutes) text += fmt::format("#SBATCH --time={}\n", *resources.minutes);
  // Slurm opens the file of --output before the script starts, so the script could not report that
  // a node lacks the job folder.
  text +=
      "#SBATCH --export=NONE\n"
      "#SBATCH --requeue\n"
      "#SBATCH --output=/dev/null\n";
  for (const std::string& option : resources.options) text += "#SBATCH " + option + "\n";
  text += folder_lines(job, stage);
  text += "ROUND=${1:-1}\nINDEX=$((${SLURM_ARRAY_TASK_ID:-0} + ${2:-0}))\n";
  text += kExcludeNode;
  text +=
      fmt::format("exec >>\"logs/slurm.{}.$INDEX.log\" 2>&1\n", schemas::farm_stage_name(stage));
  if (stage == schemas::FarmStage::kVerify) {
    text += kNoteExcluded.substr(1);
    text += kFailJob.substr(1);
    text += kTrap;
    text += task_command(job, stage) + "\ncode=$?\n";
    text += kStartFailure.substr(1);
    text += kAfterVerification.substr(1);
    return text;
  }
  text += kTrap;
  // mpirun starts its daemons by srun, which would pass no environment on.
  if (is_on_all_nodes(job, stage)) text += "unset SLURM_EXPORT_ENV\n";
  text += task_command(job, stage) + "\n";
  if (stage == schemas::FarmStage::kPreview) return text;
  text += "code=$?\n";
  text += kStartFailure.substr(1);
  text += kUnsetSlurmVariables.substr(1);
  text += kRequeueVerification.substr(1);
  text +=
      "requeue_verification\n"
      "[ \"$code\" -eq 0 ] || [ ! -e \"excluded/$SLURMD_NODENAME\" ] || exclude_node\n"
      "exit 0  # the result is in the task's record; a site may requeue tasks with other exit "
      "codes\n";
  return text;
}

std::string start_script(const schemas::FarmJobDocument& job, const std::string& job_before) {
  std::string options;
  for (const std::string& option : job.of(schemas::FarmStage::kVerify).options) {
    options += "#SBATCH " + option + "\n";
  }
  return fmt::format(
      "#!/bin/sh\n"
      "# Starts farm job {} once job {} is over; ./after names the folder of the latter.\n"
      "#SBATCH --job-name={}\n"
      "#SBATCH --nodes=1 --ntasks=1 --cpus-per-task=1 --mem=100M\n"
      "#SBATCH --export=NONE\n#SBATCH --requeue\n#SBATCH --output=/dev/null\n"
      "{}{}BEFORE={}\n{}{}{}",
      job.id, job_before, slurm_job_name(job, "start"), options,
      folder_lines(job, schemas::FarmStage::kVerify), shell_quote(job_before),
      kExcludeNode.substr(1), kFailJob.substr(1), kStart.substr(1));
}

std::string queue_start_script(const schemas::FarmJobDocument& job) {
  return fmt::format(
      "#!/bin/sh\n"
      "# Queues start.sbatch of farm job {} after the newest verification of the job in ./after.\n"
      "# Usage: sh start.sh [MINIMUM-SECONDS-TO-WAIT [CHECKS-THAT-FOUND-THAT-JOB-IDLE]]\n"
      "set -eu\ncd \"$(dirname \"$0\")\"\n{}{}",
      job.id, kUnsetSlurmVariables.substr(1), kQueueStart.substr(1));
}

std::string round_script(const schemas::FarmJobDocument& job, const schemas::FarmRound& round) {
  const std::vector<QueuedArray> prepare = prepare_arrays(job, round);
  const std::vector<ChunkGroup> groups = group_chunks(job, round.prepare, round.render);
  std::string text = fmt::format(
      "#!/bin/sh\n"
      "# Round {} of farm job {}: {} to prepare, {} to render, then the verification.\n"
      "# Usage: sh round-{}.sh   (a second run queues nothing twice)\n"
      "set -eu\ncd \"$(dirname \"$0\")\"\n",
      round.round, job.id, round.prepare.size(), round.render.size(), round.round);
  text += "[ ! -e cancelled ] || { echo 'the job was cancelled' >&2; exit 1; }\n";
  text += kUnsetSlurmVariables;
  text += "unset_slurm_variables\n";
  text += kQueue.substr(1);
  text += exclude_lines(job, schemas::FarmStage::kRender, round);
  // Hold arrays until all are queued: a forgotten task that is over cannot be a dependency.
  for (const QueuedArray& array : prepare) {
    text += fmt::format("queue {} --hold --array={}{} prepare.sbatch {} {} >/dev/null\n",
                        array.name, array_text(array.part.indices),
                        round_options(job, schemas::FarmStage::kPrepare, round), round.round,
                        array.part.offset);
    text += fmt::format("{}=$(cat slurm/{})\n", variable_of(array), array.name);
  }
  std::string all;
  int arrays = 0;
  for (const ChunkGroup& group : groups) {
    for (const ArrayPart& part : split_array(group.chunks, job.max_array_size)) {
      const std::string name = fmt::format("render.{}.{}", round.round, ++arrays);
      const std::string dependency =
          group.instants.empty()
              ? ""
              : fmt::format(" --dependency={}", dependency_on(group.instants, prepare));
      text += fmt::format("queue {} --array={}{}{} render.sbatch {} {} >/dev/null\n", name,
                          array_text(part.indices),
                          round_options(job, schemas::FarmStage::kRender, round), dependency,
                          round.round, part.offset);
      all += fmt::format(":$(cat slurm/{})", name);
    }
  }
  const std::string exclude = round.exclude.empty() ? "" : " $exclude";
  text += fmt::format("queue verify.{} --dependency=afterany{}{} verify.sbatch {} 0\n", round.round,
                      all, exclude, round.round);
  for (const QueuedArray& array : prepare) {
    text += fmt::format("scontrol release \"$(cat slurm/{})\"\n", array.name);
  }
  return text;
}

std::string preview_script(const schemas::FarmJobDocument& job, const schemas::FarmRound& round) {
  return fmt::format(
      "#!/bin/sh\n# Queues the preview of farm job {}.\nset -eu\ncd \"$(dirname "
      "\"$0\")\"\n{}unset_slurm_variables\n{}{}"
      "queue preview.{}{} preview.sbatch {} 0\n",
      job.id, kUnsetSlurmVariables, kQueue.substr(1),
      exclude_lines(job, schemas::FarmStage::kPreview, round), round.round,
      round.exclude.empty() ? "" : " $exclude", round.round);
}

void write_batch_scripts(const JobFolder& folder, const schemas::FarmJobDocument& job) {
  for (const schemas::FarmStage stage : schemas::kFarmStages) {
    write_file_atomically(folder.path() / fmt::format("{}.sbatch", schemas::farm_stage_name(stage)),
                          batch_script(job, stage));
  }
}

void write_round(const JobFolder& folder, const schemas::FarmJobDocument& job,
                 const schemas::FarmRound& round) {
  write_file_atomically(folder.round_file(round.round), schemas::format_farm_round(round));
  if (job.engine != schemas::FarmJobDocument::Engine::kSlurm) return;
  write_file_atomically(folder.path() / fmt::format("round-{}.sh", round.round),
                        round_script(job, round));
}

}  // namespace raystage::farm
