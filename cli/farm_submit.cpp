// SPDX-License-Identifier: Apache-2.0
// raystage farm submit and export: make a job of a shot.
#include <fmt/format.h>

#include <cstdio>
#include <memory>

#include "base/atomic_file.h"
#include "base/cancellation.h"
#include "cli/farm.h"
#include "cli/follow_links_option.h"
#include "cli/printing.h"
#include "compose/frame_range.h"
#include "farm/local_engine.h"
#include "farm/openjd.h"
#include "farm/retry.h"
#include "farm/rounds.h"
#include "farm/slurm_queue.h"
#include "farm/slurm_scripts.h"
#include "farm/submission.h"

namespace raystage::cli {
namespace {

using farm::SubmissionOptions;
using Engine = schemas::FarmJobDocument::Engine;

constexpr double kMinMemoryGb = 1e-3, kMaxMemoryGb = 1e5;

/// `submission` is completed after parsing, by completed().
struct Options {
  SubmissionOptions submission;
  std::string shot, frames, chunk = "auto", openjd_file;
  std::vector<std::string> maps, sbatch, partition, account, qos, priority, licenses, constraint;
  bool dry_run = false, no_queue = false, quiet = false;
  bool is_distributed = false;
  std::string nodes;
  schemas::FarmJobDocument::Distributed distributed;
  int minutes = 0;
};

/// Adds options of sbatch: "render:--exclusive" to one stage, "--exclusive" to all.
void add_to_stages(const std::vector<std::string>& values, const std::string& prefix,
                   SubmissionOptions& submission) {
  for (const std::string& value : values) {
    bool is_for_one = false;
    for (const schemas::FarmStage stage : schemas::kFarmStages) {
      const std::string name = std::string(schemas::farm_stage_name(stage)) + ":";
      if (!value.starts_with(name)) continue;
      submission.sbatch[static_cast<std::size_t>(stage)].push_back(prefix +
                                                                   value.substr(name.size()));
      is_for_one = true;
    }
    if (is_for_one) continue;
    // Only licences have a colon, before their number.
    const std::size_t colon = value.find(':');
    if (colon != std::string::npos && !prefix.empty() && prefix != "--licenses=") {
      throw Error::bad_input("there is no stage \"" + value.substr(0, colon) + "\"",
                             prefix.substr(0, prefix.size() - 1),
                             "Write prepare:, render:, verify: or preview: before the value");
    }
    for (auto& options : submission.sbatch) options.push_back(prefix + value);
  }
}

void declare_shot(CommandLine& command, Options& options) {
  SubmissionOptions& submission = options.submission;
  command.option("SHOT", options.shot, "the shot to render (shot.json)").required();
  command
      .option("-o,--output DIR/NAME.####.exr", submission.output,
              "name of the files; #### is the frame number with that many digits")
      .required();
  command.option("--frames RANGE", options.frames,
                 "frames to render, e.g. 1-48 (default: all of the shot)");
  command
      .option("--chunk N|auto", options.chunk,
              "frames per task; auto = as many as take about five minutes, by the measured "
              "frame\n(default: auto)")
      .word_or_limits("auto", 1, 1000000);
  command.flag("--preview-first", submission.preview_first, "render every tenth frame first");
  command.choice("--existing", submission.existing,
                 {{"error", compose::ExistingFiles::kError},
                  {"skip", compose::ExistingFiles::kSkip},
                  {"overwrite", compose::ExistingFiles::kOverwrite}},
                 "frames whose file exists: error = refuse to submit; skip = keep complete files "
                 "made from the\nsame inputs; overwrite = render all (default: error)");
  command.choice("--missing", submission.missing,
                 {{"error", compose::MissingFrames::kError},
                  {"hold", compose::MissingFrames::kHold},
                  {"black", compose::MissingFrames::kBlack}},
                 "frames before or after the take (default: error)");
  command.choice(
      "--rotten", submission.rotten,
      {{"error", store::RottenFrames::kError}, {"absent", store::RottenFrames::kAbsent}},
      "cameras whose stored frame is not as it was recorded (default: absent; the job is done with "
      "such\nframes, lists them, and `status` ends with exit code 4)");
  command
      .option("--least-coverage SHARE", submission.least_coverage,
              "share of the view, 0 to 1, that cameras must see; the job is done with frames below "
              "it, lists\nthem, and `status` ends with exit code 4 (default: 0)")
      .range(0.0, 1.0);
  command.option("--fill", submission.picture.fill, "unseen pixels (default: as in the shot)")
      .one_of({"none", "push-pull"});
  command.option("--layout", submission.picture.layout, "EXR layout (default: as in the shot)")
      .one_of({"standard", "single", "nuke"});
  command.option("--ocio CONFIG", submission.color_config,
                 "OpenColorIO config for the colours of the files (default: as in the shot)");
  command.flag("--chromaticities", submission.picture.chromaticities,
               "write the chromaticities attribute");
  command.flag("--coverage", submission.picture.coverage, "write channels cameras.V and nearest.V");
  command.flag("--confidence", submission.picture.confidence, "write channel confidence.V");
  command.flag("--deep", submission.picture.deep, "also write deep files");
  command.option("--cache DIR", submission.cache,
                 "folder for derived data, shared by all nodes (default: the takes; for read-only "
                 "ones,\nOUT/NAME.farm/cache)");
}

void declare_resources(CommandLine& command, Options& options) {
  SubmissionOptions& submission = options.submission;
  command.option("-j,--threads N", submission.threads, "threads per task (default: all, at most 8)")
      .range(1, 1024);
  command
      .option("--memory GB", submission.memory_gb,
              "memory of a task's renderer, GB = 10^9 bytes; 10 % and 0.4 GB more are requested "
              "from the\nscheduler (default: from the memory plan and the measured frame)")
      .range(kMinMemoryGb, kMaxMemoryGb);
  command
      .option(
          "--time MINUTES", options.minutes,
          "time limit of a task, minutes (default: four times what the measured frame predicts)")
      .range(1, 1000000);
  command.flag("!--no-measure", submission.measure,
               "do not render the first frame here to measure it");
  command.option("--attempts N", submission.attempts, "attempts before a task fails (default: 3)")
      .range(1, 100);
  command.flag("!--no-preview", submission.preview,
               "do not make a movie and contact sheet at the end");
  command
      .option("--simd", submission.simd,
              "instruction set of every task, for identical results on all nodes (default: avx2, "
              "or the best\nof this machine if it lacks avx2)")
      .one_of({"sse4", "avx2", "avx512"});
  command
      .option("--map FROM=TO", options.maps,
              "path of a folder on the nodes; repeatable, the first match counts")
      .one_argument();
  command.option("--command-prefix COMMAND", submission.command_prefix,
                 "words before the command of a task, e.g. \"apptainer exec /net/raystage.sif\"");
  command.option("--program COMMAND", submission.program,
                 "command that runs raystage on a node (default: this one, by its path)");
  add_follow_links_option(command);
  command.flag("-q,--quiet", options.quiet, "No progress on stderr");
}

void declare_slurm(CommandLine command, Options& options) {
  const auto add = [&](const std::string& name, std::vector<std::string>& values,
                       const char* help) {
    command.option(name + " [STAGE:]VALUE", values, help).one_argument();
  };
  add("--partition", options.partition, "partition");
  add("--account", options.account, "account");
  add("--qos", options.qos, "quality of service");
  add("--priority", options.priority, "priority");
  add("--licenses", options.licenses, "licences, e.g. storage:1");
  add("--constraint", options.constraint, "features that nodes must have");
  add("--sbatch", options.sbatch, "any other option, e.g. --sbatch=render:--exclusive");
}

void declare_distributed(CommandLine command, Options& options) {
  command.flag("--distributed", options.is_distributed,
               "each node renders with its own archives: a task runs on all of --nodes, under MPI");
  command.option("--nodes n[1-4]", options.nodes, "nodes that hold archives, in Slurm's notation");
  command.option("--mpirun COMMAND", options.distributed.mpirun,
                 "command that starts the ranks, with its options (default: mpirun)");
  command
      .option("--missing-archives", options.distributed.missing_archives,
              "cameras whose archives no node has: error = the job fails; absent = render without "
              "them, and\nmark the files (default: error)")
      .one_of({"error", "absent"});
  command
      .option("--fragments", options.distributed.fragments,
              "encoding of samples on the network, see raystage render --help (default: float)")
      .one_of({"float", "half", "jpeg"});
  command
      .option("--fragment-quality Q", options.distributed.fragment_quality,
              "JPEG quality of fragments (default: 85)")
      .range(1, 100);
}

void complete_distributed(const Options& options, SubmissionOptions& submission) {
  if (!options.is_distributed) {
    if (options.nodes.empty()) return;
    throw Error::bad_input("only a distributed job has nodes", "--nodes",
                           "Add --distributed, or omit --nodes");
  }
  if (options.nodes.empty()) {
    throw Error::bad_input("the nodes that hold the archives are missing", "--distributed",
                           "Add --nodes, e.g. --nodes 'n[1-4]'");
  }
  submission.distributed = options.distributed;
  submission.distributed->nodes = farm::expand_node_list(options.nodes);
}

SubmissionOptions completed(Options& options, Progress& progress) {
  SubmissionOptions& submission = options.submission;
  submission.shot = options.shot;
  if (!options.frames.empty()) submission.frames = compose::parse_frame_range(options.frames);
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

std::string resources_line(const schemas::FarmJobDocument& job, schemas::FarmStage stage,
                           std::size_t tasks) {
  const schemas::FarmResources& resources = job.of(stage);
  return fmt::format("{:<8} {:>6} {:>8} {:>8.2f} GB {:>9} {:>10}  {}\n",
                     schemas::farm_stage_name(stage), tasks, resources.threads, resources.memory_gb,
                     fmt::format("{} MiB", farm::slurm_megabytes(resources, 1)),
                     resources.minutes ? fmt::format("{} min", *resources.minutes) : "-",
                     fmt::join(resources.options, " "));
}

ExitCode show_plan(const SubmissionOptions& submission) {
  const farm::PlannedJob planned = farm::plan_submission(submission);
  const schemas::FarmJobDocument& job = planned.job;
  print(fmt::format("frames   {} ({}) in {} tasks, the first of frames {}\n",
                    farm::job_frames(job).size(),
                    compose::format_frame_range(farm::job_frames(job)), job.chunks.size(),
                    job.chunks.front().frames));
  if (job.distributed) {
    print(fmt::format("nodes    {}, all for each task of stage render\n",
                      fmt::join(job.distributed->nodes, " ")));
  }
  print(fmt::format("output   {}\nprogram  {}{}{}\nsimd     {}\n\n", job.output, job.command_prefix,
                    job.command_prefix.empty() ? "" : " ", job.program, job.simd));
  print(fmt::format("{:<8} {:>6} {:>8} {:>11} {:>9} {:>10}  {}\n", "stage", "tasks", "threads",
                    "memory", "of Slurm", "time", "options of sbatch"));
  if (!job.instants.empty())
    print(resources_line(job, schemas::FarmStage::kPrepare, job.instants.size()));
  print(resources_line(job, schemas::FarmStage::kRender, job.chunks.size()));
  print(resources_line(job, schemas::FarmStage::kVerify, 1));
  if (job.preview) print(resources_line(job, schemas::FarmStage::kPreview, 1));
  const bool all_given = submission.chunk && submission.memory_gb > 0 && submission.minutes;
  if (submission.measure && !all_given && !job.distributed && job.engine == Engine::kSlurm) {
    print(
        fmt::format("\nfarm submit will render frame {} on this machine first, to set chunk, "
                    "memory and time.\n",
                    farm::job_frames(job).front()));
  }
  print("\nNothing was written or queued. Use --no-queue to write the job with its scripts.\n");
  return ExitCode::kSuccess;
}

ExitCode submit(Options& options, std::stop_token stop) {
  Progress progress(!options.quiet);
  const SubmissionOptions submission = completed(options, progress);
  if (options.dry_run) {
    const CancellationScope cancellation(stop);
    return show_plan(submission);
  }
  if (submission.engine == Engine::kLocal && !submission.paths.empty() && !options.no_queue) {
    throw Error::bad_input("this host runs the tasks itself, with its own paths", "--map",
                           "Omit --map, or use --engine slurm");
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
        "the template violates the Open Job Description specification: " + faults.front(),
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

Subcommand declare_farm_submit(CommandLine& farm) {
  CommandLine command = farm.subcommand("submit", "check a shot and queue it as a job");
  auto options = std::make_shared<Options>();
  declare_shot(command, *options);
  command.choice(
      "--engine", options->submission.engine,
      {{"slurm", Engine::kSlurm}, {"local", Engine::kLocal}},
      "slurm = queue the tasks; local = run them on this machine, one by one (default: slurm)");
  declare_resources(command, *options);
  declare_slurm(
      command.group(
          "Slurm (for one stage: prepare:, render:, verify: or preview: before the value)"),
      *options);
  declare_distributed(command.group("Archives on several nodes (docs/farm.md)"), *options);
  command.flag("--after", options->submission.after,
               "wait for the end of another job with the same output");
  command.flag(
      "--dry-run", options->dry_run,
      "check everything and print tasks and resources; write nothing but the output folder");
  command.flag("--no-queue", options->no_queue,
               "write the job folder only; `sh JOB/round-1.sh` queues it (engine local: `raystage "
               "farm\nretry JOB` starts it)");
  command.footer(
      "Prints the job folder. It holds the job (job.json), its scripts, records and logs.");
  return {command, [options](std::stop_token stop) { return submit(*options, stop); }};
}

Subcommand declare_farm_export(CommandLine& farm) {
  CommandLine command = farm.subcommand(
      "export", "write a job for another render manager: an Open Job Description template");
  auto options = std::make_shared<Options>();
  declare_shot(command, *options);
  auto openjd = std::make_shared<bool>(false);
  command.flag("--openjd", *openjd, "as Open Job Description, version jobtemplate-2023-09")
      .required();
  command.option("--template JSON", options->openjd_file,
                 "the template to write (default: template.json in the job folder)");
  declare_resources(command, *options);
  command.footer("The tasks run on the job folder, which is written next to the output.");
  return {command, [options, openjd](std::stop_token stop) { return export_job(*options, stop); }};
}

}  // namespace raystage::cli
