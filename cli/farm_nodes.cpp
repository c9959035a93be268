// SPDX-License-Identifier: Apache-2.0
// raystage farm doctor, estimate, task: the machines, and what runs on them.
#include <fmt/format.h>
#include <tbb/task_arena.h>

#include <cstdio>
#include <memory>

#include "base/atomic_file.h"
#include "cli/choice_option.h"
#include "cli/farm.h"
#include "cli/threads.h"
#include "farm/cost_model.h"
#include "farm/cost_page.h"
#include "farm/doctor.h"
#include "farm/task.h"

namespace raystage {
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
  request.stage = parse_farm_stage(options.stage);
  request.index = options.index;
  request.round = options.round;
  request.node = options.node;
  request.timeout_seconds = options.patience_s;
  Progress progress(options.progress);
  request.progress = [&](double done) { progress.report(done); };
  request.on_message = [&](std::string_view line) { progress.say(line); };
  // The command that a task runs has threads of its own; a verification reads with one.
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
  const FarmJobDocument job = folder.local_job();
  auto costs = farm::measured_costs(job, farm::read_attempts(folder));
  if (!costs) {
    throw Error::bad_input("no task of stage render is done, so nothing is measured",
                           folder.path().string(), "Wait for the first one");
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

FarmCommand declare_farm_doctor(CLI::App& farm) {
  CLI::App* app =
      farm.add_subcommand("doctor", "ask every node whether it can carry out a job's tasks");
  struct Options {
    std::string job;
    std::vector<std::string> nodes;
    double patience_s = 60;
  };
  auto options = std::make_shared<Options>();
  add_job_argument(*app, options->job);
  app->add_option("--nodes", options->nodes, "only these nodes (default: all of the partition)")
      ->delimiter(',')
      ->type_name("NODE,...");
  app->add_option("--wait", options->patience_s, "seconds to wait for answers (default: 60)")
      ->check(CLI::Range(1.0, 86400.0))
      ->type_name("S");
  app->footer(
      "To ask before anything is rendered: raystage farm submit --no-queue writes a job without\n"
      "queueing it. Exit codes: 0 every node is ready; 1 some are not.");
  return {app, [options](std::stop_token stop) {
            const auto reports = farm::check_nodes(farm::find_job(options->job), options->nodes,
                                                   options->patience_s, stop);
            print(farm::doctor_text(reports));
            for (const farm::NodeReport& report : reports) {
              if (!report.fault.empty()) return ExitCode::kFailed;
            }
            return ExitCode::kSuccess;
          }};
}

FarmCommand declare_farm_estimate(CLI::App& farm) {
  CLI::App* app =
      farm.add_subcommand("estimate", "predict how a job scales, from what its tasks took");
  auto options = std::make_shared<EstimateOptions>();
  add_job_argument(*app, options->job);
  app->add_option("--nodes", options->nodes, "numbers of nodes (default: 1,2,4,10,100,1000)")
      ->delimiter(',')
      ->check(CLI::Range(1, 1000000))
      ->type_name("N,...");
  app->add_option("--cores", options->site.cores_per_node, "cores of a node (default: 2)")
      ->check(CLI::Range(1, 100000))
      ->type_name("N");
  app->add_option("--frames", options->frames, "frames of the shot (default: the job's)")
      ->check(CLI::Range(1, 100000000))
      ->type_name("N");
  app->add_option("--tasks", options->chunks, "tasks of stage render (default: the job's)")
      ->check(CLI::Range(1, 100000000))
      ->type_name("N");
  app->add_option("--instants", options->instants,
                  "light field frames to prepare (default: the job's)")
      ->check(CLI::Range(0, 100000000))
      ->type_name("N");
  app->add_option("--storage-read", options->read_mb, "shared storage reads, MB/s (default: 1000)")
      ->check(CLI::PositiveNumber)
      ->type_name("MB/S");
  app->add_option("--storage-write", options->write_mb,
                  "shared storage writes, MB/s (default: 1000)")
      ->check(CLI::PositiveNumber)
      ->type_name("MB/S");
  app->add_option("--frame-read", options->frame_read_mb,
                  "JPEG data that a frame reads, MB (default: as the job's records show)")
      ->check(CLI::NonNegativeNumber)
      ->type_name("MB");
  app->add_option("--task-seconds", options->task_s,
                  "seconds of a task besides its frames and the latency (default: as the job's "
                  "records show)")
      ->check(CLI::NonNegativeNumber)
      ->type_name("S");
  app->add_option("--latency", options->latency_s,
                  "seconds from a free slot to a running task (default: as the job's records show)")
      ->check(CLI::NonNegativeNumber)
      ->type_name("S");
  app->add_option("--starts", options->site.starts_per_s,
                  "tasks that the scheduler starts in a second (default: 50)")
      ->check(CLI::PositiveNumber)
      ->type_name("N/S");
  app->add_option("-o,--output", options->page, "page with a chart to write")->type_name("HTML");
  return {app, [options](std::stop_token /*stop*/) { return estimate(*options); }};
}

FarmCommand declare_farm_task(CLI::App& farm) {
  CLI::App* app =
      farm.add_subcommand("task", "carry out one task of a job: what the batch scripts run");
  auto options = std::make_shared<TaskOptions>();
  app->add_option("JOB", options->job, "job folder")->required();
  app->add_option("STAGE", options->stage, "prepare, render, verify, preview, or doctor")
      ->required()
      ->check(CLI::IsMember({"prepare", "render", "verify", "preview", "doctor"}).description(""))
      ->type_name("STAGE");
  app->add_option("INDEX", options->index, "task within the stage (default: 0)")
      ->check(CLI::Range(0, 100000000));
  app->add_option("--round", options->round, "round that queued it (default: 1)")
      ->check(CLI::Range(1, 100000))
      ->type_name("N");
  app->add_option("--node", options->node,
                  "the scheduler's name of this node (default: $SLURMD_NODENAME, else the host's "
                  "name)")
      ->type_name("NODE");
  app->add_option("--map", options->maps, "a folder that has another name here; repeatable")
      ->type_name("FROM=TO")
      ->take_all()
      ->allow_extra_args(false);
  app->add_option("--path-mapping", options->path_mapping,
                  "the same as an Open Job Description session writes it")
      ->type_name("JSON");
  app->add_option(
         "--patience", options->patience_s,
         "seconds that stage verify looks for files that are missing or stale (default: 60)")
      ->check(CLI::Range(0.0, 86400.0))
      ->type_name("S");
  add_choice<ProgressStyle>(*app, "--progress", options->progress,
                            {{"plain", ProgressStyle::kPlain},
                             {"openjd", ProgressStyle::kOpenJd},
                             {"none", ProgressStyle::kNone}},
                            "on stderr (default: none; what a task prints is in JOB/logs)");
  return {app, [options](std::stop_token stop) { return run_task(*options, stop); }};
}

}  // namespace raystage
