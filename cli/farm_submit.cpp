// SPDX-License-Identifier: Apache-2.0
// raystage farm submit and export: a shot becomes a job.
#include <fmt/format.h>

#include <cstdio>
#include <memory>

#include "base/atomic_file.h"
#include "cli/choice_option.h"
#include "cli/farm.h"
#include "compose/frame_range.h"
#include "farm/local_engine.h"
#include "farm/openjd.h"
#include "farm/retry.h"
#include "farm/rounds.h"
#include "farm/slurm_queue.h"
#include "farm/slurm_scripts.h"
#include "farm/submission.h"

namespace raystage {
namespace {

using farm::SubmissionOptions;
using Engine = FarmJobDocument::Engine;

constexpr double kLeastMemoryGb = 1e-3, kMostMemoryGb = 1e5;

/// What the command line says; `submission` is complete once it is parsed.
struct Options {
  SubmissionOptions submission;
  std::string shot, frames, chunk = "auto", openjd_file;
  std::vector<std::string> maps, sbatch, partition, account, qos, priority, licenses, constraint;
  bool dry_run = false, no_queue = false, quiet = false;
  bool is_distributed = false;
  std::string nodes;
  FarmJobDocument::Distributed distributed;
  int minutes = 0;
};

/// "render:--exclusive" is for one stage, "--exclusive" for all.
void add_to_stages(const std::vector<std::string>& values, const std::string& prefix,
                   SubmissionOptions& submission) {
  for (const std::string& value : values) {
    bool is_for_one = false;
    for (const FarmStage stage : kFarmStages) {
      const std::string name = std::string(farm_stage_name(stage)) + ":";
      if (!value.starts_with(name)) continue;
      submission.sbatch[static_cast<std::size_t>(stage)].push_back(prefix +
                                                                   value.substr(name.size()));
      is_for_one = true;
    }
    if (is_for_one) continue;
    // A licence's number follows a colon; nothing else has one.
    const std::size_t colon = value.find(':');
    if (colon != std::string::npos && !prefix.empty() && prefix != "--licenses=") {
      throw Error::bad_input("there is no stage \"" + value.substr(0, colon) + "\"",
                             prefix.substr(0, prefix.size() - 1),
                             "Write prepare:, render:, verify: or preview: before the value");
    }
    for (auto& options : submission.sbatch) options.push_back(prefix + value);
  }
}

void declare_shot(CLI::App& app, Options& options) {
  SubmissionOptions& submission = options.submission;
  app.add_option("SHOT", options.shot, "the shot to render (shot.json)")->required();
  app.add_option("-o,--output", submission.output,
                 "name of the frames; #### is the frame number with that many digits")
      ->required()
      ->type_name("DIR/NAME.####.exr");
  app.add_option("--frames", options.frames,
                 "frames to render, e.g. 1-48 (default: all of the shot)")
      ->type_name("RANGE");
  app.add_option("--chunk", options.chunk,
                 "frames of a task, or auto: a task of about five minutes by the measured frame\n"
                 "(default: auto)")
      ->check([](const std::string& text) -> std::string {
        if (text == "auto") return "";
        return CLI::Range(1, 1000000)(text);
      })
      ->type_name("N|auto");
  app.add_flag("--preview-first", submission.preview_first, "queue every tenth frame first");
  add_choice<ExistingFiles>(app, "--existing", submission.existing,
                            {{"error", ExistingFiles::kError},
                             {"skip", ExistingFiles::kSkip},
                             {"overwrite", ExistingFiles::kOverwrite}},
                            "frames whose file is there: error = refuse to submit; skip = keep "
                            "files that are whole\nand were made from the same inputs; overwrite = "
                            "render all (default: error)");
  add_choice<MissingFrames>(app, "--missing", submission.missing,
                            {{"error", MissingFrames::kError},
                             {"hold", MissingFrames::kHold},
                             {"black", MissingFrames::kBlack}},
                            "frames before or after the take (default: error)");
  app.add_option("--fill", submission.picture.fill,
                 "rays that no camera saw (default: what the shot says)")
      ->check(CLI::IsMember({"none", "push-pull"}).description(""))
      ->type_name("none|push-pull");
  app.add_option("--layout", submission.picture.layout,
                 "layout of the EXR files (default: what the shot says)")
      ->check(CLI::IsMember({"standard", "single", "nuke"}).description(""))
      ->type_name("standard|single|nuke");
  app.add_option("--ocio", submission.color_config,
                 "OpenColorIO config for the colours of the files (default: what the shot says)")
      ->type_name("CONFIG");
  app.add_flag("--chromaticities", submission.picture.chromaticities,
               "write the chromaticities attribute");
  app.add_flag("--coverage", submission.picture.coverage, "write lf.cameras and lf.nearest");
  app.add_flag("--confidence", submission.picture.confidence, "write lf.confidence");
  app.add_flag("--deep", submission.picture.deep, "write deep files in addition");
  app.add_option("--cache", submission.cache,
                 "folder for derived data, seen by all nodes (default: the takes; where one is "
                 "read-only,\nOUT/NAME.farm/cache)")
      ->type_name("DIR");
}

void declare_resources(CLI::App& app, Options& options) {
  SubmissionOptions& submission = options.submission;
  app.add_option("-j,--threads", submission.threads,
                 "threads of a task (default: those of this machine, at most 8)")
      ->check(CLI::Range(1, 1024))
      ->type_name("N");
  app.add_option("--memory", submission.memory_gb,
                 "memory of a task's renderer, GB = 10^9 bytes; the scheduler is asked for a tenth "
                 "and 0.4 GB\nmore (default: from the memory plan and the measured frame)")
      ->check(CLI::Range(kLeastMemoryGb, kMostMemoryGb))
      ->type_name("GB");
  app.add_option("--time", options.minutes,
                 "time limit of a task, minutes (default: four times what the measured frame "
                 "predicts)")
      ->check(CLI::Range(1, 1000000))
      ->type_name("MINUTES");
  app.add_flag("!--no-measure", submission.measure,
               "do not render the first frame here to measure it");
  app.add_option("--attempts", submission.attempts,
                 "how often a task may fail before its frames are given up (default: 3)")
      ->check(CLI::Range(1, 100))
      ->type_name("N");
  app.add_flag("!--no-preview", submission.preview, "make no movie and contact sheet at the end");
  app.add_option("--simd", submission.simd,
                 "SIMD level of every task, so that all nodes give the same bytes (default: avx2, "
                 "or the best of\nthis machine where it lacks that)")
      ->check(CLI::IsMember({"sse4", "avx2", "avx512"}).description(""))
      ->type_name("sse4|avx2|avx512");
  app.add_option("--map", options.maps,
                 "a folder that has another name on the nodes; repeatable, the first that fits "
                 "counts")
      ->type_name("FROM=TO")
      ->take_all()
      ->allow_extra_args(false);
  app.add_option("--command-prefix", submission.command_prefix,
                 "words before the command of a task, e.g. \"apptainer exec /net/raystage.sif\"")
      ->type_name("COMMAND");
  app.add_option("--program", submission.program,
                 "command that runs raystage on a node (default: this one, by its path)")
      ->type_name("COMMAND");
  app.add_flag("-q,--quiet", options.quiet, "No progress on stderr");
}

void declare_slurm(CLI::App& app, Options& options) {
  const auto add = [&](const char* name, std::vector<std::string>& values, const char* help) {
    app.add_option(name, values, help)
        ->type_name("[STAGE:]VALUE")
        ->take_all()
        ->allow_extra_args(false)
        ->group("Slurm (for one stage: prepare:, render:, verify: or preview: before the value)");
  };
  add("--partition", options.partition, "partition");
  add("--account", options.account, "account");
  add("--qos", options.qos, "quality of service");
  add("--priority", options.priority, "priority");
  add("--licenses", options.licenses, "licences, e.g. storage:1");
  add("--constraint", options.constraint, "features that nodes must have");
  add("--sbatch", options.sbatch, "any other option, e.g. --sbatch=render:--exclusive");
}

void declare_distributed(CLI::App& app, Options& options) {
  const char* const group = "Archives on several nodes (docs/farm.md)";
  app.add_flag(
         "--distributed", options.is_distributed,
         "archives stay on the nodes that hold them: a task runs on all of --nodes, under MPI")
      ->group(group);
  app.add_option("--nodes", options.nodes, "nodes that hold archives, as Slurm writes them")
      ->type_name("n[1-4]")
      ->group(group);
  app.add_option("--mpirun", options.distributed.mpirun,
                 "command that starts the ranks, with its options (default: mpirun)")
      ->type_name("COMMAND")
      ->group(group);
  app.add_option(
         "--missing-archives", options.distributed.missing_archives,
         "cameras whose archives no node has: error = the job fails; absent = they are left "
         "out and marked\n(default: error)")
      ->check(CLI::IsMember({"error", "absent"}).description(""))
      ->type_name("error|absent")
      ->group(group);
  app.add_option("--fragments", options.distributed.fragments,
                 "how samples cross the network, see raystage render --help (default: float)")
      ->check(CLI::IsMember({"float", "half", "jpeg"}).description(""))
      ->type_name("float|half|jpeg")
      ->group(group);
  app.add_option("--fragment-quality", options.distributed.fragment_quality,
                 "JPEG quality of fragments (default: 85)")
      ->check(CLI::Range(1, 100))
      ->type_name("Q")
      ->group(group);
}

void complete_distributed(const Options& options, SubmissionOptions& submission) {
  if (!options.is_distributed) {
    if (options.nodes.empty()) return;
    throw Error::bad_input("nodes are named for a job that is not distributed", "--nodes",
                           "Add --distributed, or leave --nodes out");
  }
  if (options.nodes.empty()) {
    throw Error::bad_input("the nodes that hold the archives are not named", "--distributed",
                           "Add --nodes, e.g. --nodes 'n[1-4]'");
  }
  submission.distributed = options.distributed;
  submission.distributed->nodes = farm::expand_node_list(options.nodes);
}

SubmissionOptions completed(Options& options, Progress& progress) {
  SubmissionOptions& submission = options.submission;
  submission.shot = options.shot;
  if (!options.frames.empty()) submission.frames = parse_frame_range(options.frames);
  if (options.chunk != "auto") submission.chunk = std::stoi(options.chunk);
  if (options.minutes > 0) submission.minutes = options.minutes;
  for (const std::string& map : options.maps)
    submission.paths.push_back(farm::parse_path_rule(map));
  add_to_stages(options.partition, "--partition=", submission);
  add_to_stages(options.account, "--account=", submission);
  add_to_stages(options.qos, "--qos=", submission);
  add_to_stages(options.priority, "--priority=", submission);
  add_to_stages(options.licenses, "--licenses=", submission);
  add_to_stages(options.constraint, "--constraint=", submission);
  add_to_stages(options.sbatch, "", submission);
  complete_distributed(options, submission);
  if (!options.quiet)
    submission.on_message = [&progress](std::string_view line) { progress.say(line); };
  return submission;
}

std::string resources_line(const FarmJobDocument& job, FarmStage stage, std::size_t tasks) {
  const FarmResources& resources = job.of(stage);
  return fmt::format("{:<8} {:>6} {:>8} {:>8.2f} GB {:>9} {:>10}  {}\n", farm_stage_name(stage),
                     tasks, resources.threads, resources.memory_gb,
                     fmt::format("{} MiB", farm::slurm_megabytes(resources, 1)),
                     resources.minutes ? fmt::format("{} min", *resources.minutes) : "-",
                     fmt::join(resources.options, " "));
}

ExitCode show_plan(const SubmissionOptions& submission) {
  const farm::PlannedJob planned = farm::plan_submission(submission);
  const FarmJobDocument& job = planned.job;
  print(fmt::format("frames   {} ({}) in {} tasks, the first of frames {}\n",
                    farm::job_frames(job).size(), format_frame_range(farm::job_frames(job)),
                    job.chunks.size(), job.chunks.front().frames));
  if (job.distributed) {
    print(fmt::format("nodes    {}, all for each task of stage render\n",
                      fmt::join(job.distributed->nodes, " ")));
  }
  print(fmt::format("output   {}\nprogram  {}{}{}\nsimd     {}\n\n", job.output, job.command_prefix,
                    job.command_prefix.empty() ? "" : " ", job.program, job.simd));
  print(fmt::format("{:<8} {:>6} {:>8} {:>11} {:>9} {:>10}  {}\n", "stage", "tasks", "threads",
                    "memory", "of Slurm", "time", "options of sbatch"));
  if (!job.instants.empty()) print(resources_line(job, FarmStage::kPrepare, job.instants.size()));
  print(resources_line(job, FarmStage::kRender, job.chunks.size()));
  print(resources_line(job, FarmStage::kVerify, 1));
  if (job.preview) print(resources_line(job, FarmStage::kPreview, 1));
  const bool all_given = submission.chunk && submission.memory_gb > 0 && submission.minutes;
  if (submission.measure && !all_given && !job.distributed && job.engine == Engine::kSlurm) {
    print(
        fmt::format("\nA submission renders frame {} here first: chunk, memory and time that are "
                    "not given follow from it.\n",
                    farm::job_frames(job).front()));
  }
  print("\nNothing was written or queued. --no-queue writes the job with its scripts.\n");
  return ExitCode::kSuccess;
}

ExitCode submit(Options& options, std::stop_token stop) {
  Progress progress(!options.quiet);
  const SubmissionOptions submission = completed(options, progress);
  if (options.dry_run) return show_plan(submission);
  if (submission.engine == Engine::kLocal && !submission.paths.empty() && !options.no_queue) {
    throw Error::bad_input("this host runs the tasks itself, by its own paths", "--map",
                           "Leave --map out, or use --engine slurm");
  }
  const farm::JobFolder folder = farm::write_submission(submission, stop);
  print(folder.path().string() + "\n");
  std::fflush(stdout);
  if (submission.engine == Engine::kLocal && !options.no_queue) {
    farm::LocalOptions local;
    local.progress = [&](double done) { progress.report(done); };
    if (!options.quiet) local.on_message = [&](std::string_view line) { progress.say(line); };
    return farm::run_job_locally(folder, local, stop);
  }
  if (!options.no_queue) farm::queue_round(folder, folder.rounds().front());
  return ExitCode::kSuccess;
}

ExitCode export_job(Options& options, std::stop_token stop) {
  Progress progress(!options.quiet);
  SubmissionOptions submission = completed(options, progress);
  submission.engine = Engine::kOpenJd;
  submission.measure = false;
  const farm::JobFolder folder = farm::write_submission(submission, stop);
  const std::string text = farm::openjd_template(folder.job());
  if (const auto faults = farm::validate_openjd_template(text); !faults.empty()) {
    throw Error::bad_input(
        "the template would break a rule of Open Job Description: " + faults.front(),
        folder.path().string(), "Use shorter paths and names");
  }
  const std::filesystem::path file = options.openjd_file.empty()
                                         ? folder.path() / "template.json"
                                         : std::filesystem::path(options.openjd_file);
  write_file_atomically(file, text);
  print(file.string() + "\n");
  return ExitCode::kSuccess;
}

}  // namespace

FarmCommand declare_farm_submit(CLI::App& farm) {
  CLI::App* app = farm.add_subcommand("submit", "check a shot and queue it as a job");
  auto options = std::make_shared<Options>();
  declare_shot(*app, *options);
  add_choice<Engine>(*app, "--engine", options->submission.engine,
                     {{"slurm", Engine::kSlurm}, {"local", Engine::kLocal}},
                     "slurm = queue the tasks; local = run them here, one after the other "
                     "(default: slurm)");
  declare_resources(*app, *options);
  declare_slurm(*app, *options);
  declare_distributed(*app, *options);
  app->add_flag("--after", options->submission.after,
                "wait for a job of the same output that is not over");
  app->add_flag("--dry-run", options->dry_run,
                "check everything and print tasks and resources; write nothing but the output "
                "folder");
  app->add_flag("--no-queue", options->no_queue,
                "write the job folder only; `sh JOB/round-1.sh` queues it (engine local: `raystage "
                "farm\nretry JOB` starts it)");
  app->footer("Prints the job folder. It holds the job (job.json), its scripts, records and logs.");
  return {app, [options](std::stop_token stop) { return submit(*options, stop); }};
}

FarmCommand declare_farm_export(CLI::App& farm) {
  CLI::App* app = farm.add_subcommand(
      "export", "write a job for another render manager: an Open Job Description template");
  auto options = std::make_shared<Options>();
  declare_shot(*app, *options);
  auto openjd = std::make_shared<bool>(false);
  app->add_flag("--openjd", *openjd, "as Open Job Description, version jobtemplate-2023-09")
      ->required();
  app->add_option("--template", options->openjd_file,
                  "the template to write (default: template.json in the job folder)")
      ->type_name("JSON");
  declare_resources(*app, *options);
  app->footer("The tasks run on the job folder, which is written next to the output.");
  return {app, [options, openjd](std::stop_token stop) { return export_job(*options, stop); }};
}

}  // namespace raystage
