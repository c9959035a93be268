// SPDX-License-Identifier: Apache-2.0
// raystage farm doctor, estimate, task: checks of nodes, cost model, a single task.
#include <fmt/format.h>
#include <tbb/task_arena.h>

#include <cstdio>
#include <memory>

#include "base/atomic_file.h"
#include "cli/farm.h"
#include "cli/printing.h"
#include "cli/threads.h"
#include "farm/cost_model.h"
#include "farm/cost_page.h"
#include "farm/doctor.h"
#include "farm/task.h"

namespace raystage::cli {
namespace {

struct TaskOptions {
  std::string job, stage, node;
  int index = 0, round = 1;
  std::vector<std::string> maps;
  std::string path_mapping;
  double patience_s = 60;
  ProgressStyle progress = ProgressStyle::kNone;
};

ExitCode run_task(const TaskOptions& options, const std::stop_token& stop) {
  farm::TaskRequest request{farm::JobFolder(options.job)};
  for (const std::string& map : options.maps) request.paths.push_back(farm::parse_path_rule(map));
  if (!options.path_mapping.empty()) {
    for (farm::PathMappingRule& rule : farm::read_path_mapping(options.path_mapping)) {
      request.paths.push_back(std::move(rule));
    }
  }
  if (options.stage == "doctor") {
    const farm::MappedJob mapped = farm::read_mapped_job(request.folder, request.paths);
    print(farm::format_node_report(farm::check_node(mapped.job, options.job, options.node)));
    return ExitCode::kSuccess;
  }
  request.stage = schemas::parse_farm_stage(options.stage);
  request.index = options.index;
  request.round = options.round;
  request.node = options.node;
  request.timeout_seconds = options.patience_s;
  Progress progress(options.progress);
  request.progress = [&](double done) { progress.report(done); };
  request.on_message = [&](std::string_view line) { progress.say(line); };
  // The command that a task runs has its own threads; a verification reads with one.
  const ThreadLimit limit(1);
  tbb::task_arena arena(1);
  return arena.execute([&] { return farm::run_task(request, stop); });
}

struct EstimateOptions {
  std::string job, page;
  std::vector<int> nodes{1, 2, 4, 10, 100, 1000};
  farm::SiteParameters site;
  double read_mb = 1000, write_mb = 1000;
  double frame_read_mb = -1, task_s = -1, latency_s = -1;  ///< negative: as measured
  int frames = 0, chunks = 0, instants = -1;
};

ExitCode estimate(EstimateOptions options) {
  const farm::JobFolder folder = farm::find_job(options.job);
  const schemas::FarmJobDocument job = folder.local_job();
  auto costs = farm::measured_costs(job, farm::read_attempts(folder));
  if (!costs) {
    throw Error::bad_input("no task of stage render is done, so no cost was measured",
                           folder.path().string(), "Wait for the first task");
  }
  options.site.storage_read_bytes_per_s = options.read_mb * 1e6;
  options.site.storage_write_bytes_per_s = options.write_mb * 1e6;
  if (options.frame_read_mb >= 0) costs->frame_read_bytes = options.frame_read_mb * 1e6;
  if (options.task_s >= 0) costs->task_s = options.task_s;
  if (options.latency_s >= 0) {
    options.site.start_latency_s = options.latency_s;
  } else if (costs->gap_s) {
    options.site.start_latency_s = *costs->gap_s;
  }
  if (options.frames > 0) costs->frames = options.frames;
  if (options.chunks > 0) costs->chunks = options.chunks;
  if (options.instants >= 0) costs->instants = options.instants;
  print(farm::cost_text(*costs, options.site, options.nodes));
  if (!options.page.empty()) {
    write_file_atomically(options.page, farm::cost_page(*costs, options.site, options.nodes,
                                                        "How farm job " + job.id + " scales"));
  }
  return ExitCode::kSuccess;
}

}  // namespace

Subcommand declare_farm_doctor(CommandLine& farm) {
  CommandLine command = farm.subcommand("doctor", "check whether every node can run a job's tasks");
  struct Options {
    std::string job;
    std::vector<std::string> nodes;
    double patience_s = 60;
  };
  auto options = std::make_shared<Options>();
  add_job_argument(command, options->job);
  command.option("--nodes NODE,...", options->nodes, "nodes to check (default: the partition's)")
      .comma_separated();
  command.option("--wait S", options->patience_s, "seconds to wait for answers (default: 60)")
      .range(1.0, 86400.0);
  command.footer(
      "To check before rendering: raystage farm submit --no-queue writes a job without queueing "
      "it.\nExit codes: 0 all nodes are ready; 1 some are not.");
  return {command, [options](std::stop_token stop) {
            const auto reports = farm::check_nodes(farm::find_job(options->job), options->nodes,
                                                   options->patience_s, stop);
            print(farm::doctor_text(reports));
            for (const farm::NodeReport& report : reports) {
              if (!report.fault.empty()) return ExitCode::kFailed;
            }
            return ExitCode::kSuccess;
          }};
}

Subcommand declare_farm_estimate(CommandLine& farm) {
  CommandLine command =
      farm.subcommand("estimate", "predict how a job scales, from the measured costs of its tasks");
  auto options = std::make_shared<EstimateOptions>();
  add_job_argument(command, options->job);
  command.option("--nodes N,...", options->nodes, "numbers of nodes (default: 1,2,4,10,100,1000)")
      .comma_separated()
      .range(1, 1000000);
  command.option("--cores N", options->site.cores_per_node, "cores of a node (default: 2)")
      .range(1, 100000);
  command.option("--frames N", options->frames, "frames of the shot (default: the job's)")
      .range(1, 100000000);
  command.option("--tasks N", options->chunks, "tasks of stage render (default: the job's)")
      .range(1, 100000000);
  command.option("--instants N", options->instants, "light field frames (default: the job's)")
      .range(0, 100000000);
  command.option("--storage-read MB/S", options->read_mb, "storage reads, MB/s (default: 1000)")
      .positive();
  command.option("--storage-write MB/S", options->write_mb, "storage writes, MB/s (default: 1000)")
      .positive();
  command.option("--frame-read MB", options->frame_read_mb, "JPEG MB per frame (default: measured)")
      .non_negative();
  command
      .option("--task-seconds S", options->task_s,
              "seconds of a task in addition to frames and latency (default: measured)")
      .non_negative();
  command
      .option("--latency S", options->latency_s,
              "seconds from a free slot to a running task (default: measured)")
      .non_negative();
  command.option("--starts N/S", options->site.starts_per_s, "task starts per second (default: 50)")
      .positive();
  command.option("-o,--output HTML", options->page, "HTML page with a chart to write");
  return {command, [options](std::stop_token /*stop*/) { return estimate(*options); }};
}

Subcommand declare_farm_task(CommandLine& farm) {
  CommandLine command = farm.subcommand("task", "run one task of a job, as the batch scripts do");
  auto options = std::make_shared<TaskOptions>();
  command.option("JOB", options->job, "job folder").required();
  command.option("STAGE", options->stage, "stage of the task")
      .required()
      .one_of({"prepare", "render", "verify", "preview", "doctor"});
  command.option("INDEX", options->index, "task within the stage (default: 0)").range(0, 100000000);
  command.option("--round N", options->round, "round of the task (default: 1)").range(1, 100000);
  command.option(
      "--node NODE", options->node,
      "name of this node in the scheduler (default: $SLURMD_NODENAME, else the host's name)");
  command.option("--map FROM=TO", options->maps, "path of a job's folder on this node; repeatable")
      .one_argument();
  command.option("--path-mapping JSON", options->path_mapping,
                 "path mapping file of an Open Job Description session");
  command
      .option("--patience S", options->patience_s,
              "seconds that stage verify waits for missing or stale files (default: 60)")
      .range(0.0, 86400.0);
  command.choice("--progress", options->progress,
                 {{"plain", ProgressStyle::kPlain},
                  {"openjd", ProgressStyle::kOpenJd},
                  {"none", ProgressStyle::kNone}},
                 "style of progress on stderr (default: none; a task's output is in JOB/logs)");
  return {command, [options](std::stop_token stop) { return run_task(*options, stop); }};
}

}  // namespace raystage::cli
