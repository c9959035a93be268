// SPDX-License-Identifier: Apache-2.0
// raystage farm status, retry, cancel, logs: commands for a submitted job.
#include <fmt/format.h>
#include <unistd.h>

#include <chrono>
#include <cstdio>
#include <memory>
#include <thread>

#include "base/atomic_file.h"
#include "cli/farm.h"
#include "cli/printing.h"
#include "compose/frame_range.h"
#include "farm/local_engine.h"
#include "farm/retry.h"
#include "farm/rounds.h"
#include "farm/slurm_queue.h"
#include "farm/status.h"
#include "farm/verification.h"

namespace raystage::cli {
namespace {

struct StatusOptions {
  std::string job, html;
  bool watch = false, json = false, all = false;
  double interval_s = 5;
};

/// Returns 0 for a job that is done or running, 3 for missing frames, 4 for complete frames that
/// fall short, otherwise 1.
ExitCode exit_code_of(const farm::JobStatus& status) {
  switch (status.state) {
    case farm::JobState::kFailed:
      return status.missing_frames.empty() ? ExitCode::kFailed : ExitCode::kSomeFramesFailed;
    case farm::JobState::kStalled:
    case farm::JobState::kCancelled:
    case farm::JobState::kStopped:
      return ExitCode::kFailed;
    case farm::JobState::kDone:
      if (!status.missing_frames.empty()) return ExitCode::kSomeFramesFailed;
      return status.frames_below_coverage.empty() && status.frames_with_rot.empty()
                 ? ExitCode::kSuccess
                 : ExitCode::kFellShort;
    default:
      return ExitCode::kSuccess;
  }
}

ExitCode show_status(const StatusOptions& options, const std::stop_token& stop) {
  const farm::JobFolder folder = farm::find_job(options.job);
  while (true) {
    const farm::JobStatus status = farm::job_status(folder);
    if (!options.html.empty()) {
      write_file_atomically(options.html, farm::status_html(status, folder));
    }
    const bool redraw = options.watch && !options.json && isatty(STDOUT_FILENO) == 1;
    if (redraw) std::fputs("\033[H\033[2J", stdout);
    print(options.json ? farm::status_json(status) + "\n" : farm::status_text(status, options.all));
    std::fflush(stdout);
    const bool goes_on = status.is_live() || status.is_preview_running();
    if (!options.watch || !goes_on || stop.stop_requested()) return exit_code_of(status);
    const auto until =
        std::chrono::steady_clock::now() + std::chrono::duration<double>(options.interval_s);
    while (!stop.stop_requested() && std::chrono::steady_clock::now() < until) {
      std::this_thread::sleep_for(std::chrono::milliseconds(50));
    }
    if (stop.stop_requested()) return ExitCode::kFailed;
  }
}

ExitCode retry(const std::string& job_name, const std::string& frames,
               const std::stop_token& stop) {
  const farm::JobFolder folder = farm::find_job(job_name);
  std::optional<std::vector<int>> wanted;
  if (!frames.empty()) wanted = compose::parse_frame_range(frames);
  const schemas::FarmRound round = farm::write_retry_round(folder, wanted, stop);
  print(fmt::format("round {}: {} tasks to render, {} to prepare\n", round.round,
                    round.render.size(), round.prepare.size()));
  std::fflush(stdout);
  switch (folder.job().engine) {
    case schemas::FarmJobDocument::Engine::kSlurm:
      farm::queue_round(folder, round);
      return ExitCode::kSuccess;
    case schemas::FarmJobDocument::Engine::kLocal: {
      Progress progress;
      farm::LocalOptions local;
      local.progress = [&](double done) { progress.report(done); };
      local.on_message = [&](std::string_view line) { progress.say(line); };
      return farm::run_job_locally(folder, local, stop);
    }
    default:
      print(fmt::format("run these tasks again in the render manager, with --round {}\n",
                        round.round));
      return ExitCode::kSuccess;
  }
}

ExitCode cancel(const std::string& job_name) {
  const farm::JobFolder folder = farm::find_job(job_name);
  const schemas::FarmJobDocument job = folder.local_job();
  if (const auto end = folder.end()) {
    throw Error::bad_input(
        "the job has ended: it is " + std::string(schemas::farm_end_state_name(end->state)),
        folder.path().string(), "Cancel only jobs that are queued or running");
  }
  // Written first, so that a verification that ends now queues nothing more.
  write_file_atomically(folder.cancel_file(), "");
  if (job.engine == schemas::FarmJobDocument::Engine::kSlurm) farm::cancel_slurm_job(job);
  if (job.engine == schemas::FarmJobDocument::Engine::kLocal) farm::stop_local_job(folder);
  schemas::FarmEnd end;
  end.state = schemas::FarmEnd::State::kCancelled;
  end.frames = static_cast<int>(farm::job_frames(job).size());
  farm::end_job(folder, job, end);
  print(fmt::format("job {} is cancelled; its complete frames are kept\n", job.id));
  return ExitCode::kSuccess;
}

ExitCode show_logs(const std::string& job_name, int frame, int only_attempt) {
  const farm::JobFolder folder = farm::find_job(job_name);
  const schemas::FarmJobDocument job = folder.job();
  const std::vector<int> wanted{frame};
  const std::vector<int> chunks = farm::chunks_with_frames(job, wanted);
  if (chunks.empty()) {
    throw Error::bad_input(fmt::format("frame {} is not in the job, which has {}", frame,
                                       compose::format_frame_range(farm::job_frames(job))),
                           folder.path().string(), "Name a frame of the job");
  }
  const farm::TaskAttempts attempts = farm::read_attempts(folder);
  bool any = false;
  const auto show = [&](const std::string& stage, int index) {
    const auto found = attempts.find({stage, index});
    if (found == attempts.end()) return;
    for (const schemas::FarmAttempt& attempt : found->second) {
      if (only_attempt > 0 && attempt.attempt != only_attempt) continue;
      any = true;
      print(fmt::format(
          "==> {} on {}, started {}: {}\n", farm::attempt_name(attempt),
          printable_in_line(attempt.node), format_utc(attempt.started_utc),
          attempt.end ? fmt::format("{}{}{}", schemas::attempt_result_name(attempt.end->result),
                                    attempt.end->reason.empty() ? "" : ": ",
                                    printable_in_line(attempt.end->reason))
                      : "end not recorded"));
      const auto log = farm::read_record(folder.contained(farm::attempt_log(folder, attempt)));
      if (log) print(log->ends_with('\n') ? *log : *log + "\n");
    }
  };
  for (const int chunk : chunks) {
    for (const int instant : job.chunks[chunk].instants) {
      show("prepare", instant);
    }
    show("render", chunk);
  }
  if (!any && only_attempt > 0) {
    throw Error::bad_input(fmt::format("frame {1} has no attempt {0}", only_attempt, frame),
                           folder.path().string(), "Omit --attempt to see all");
  }
  if (any) return ExitCode::kSuccess;
  print(fmt::format("no attempt at frame {} has started\n", frame));
  for (const int chunk : chunks) {  // the shell's messages, if it could not start the command
    const auto file = folder.logs() / fmt::format("slurm.render.{}.log", chunk);
    if (const auto log = farm::read_record(folder.contained(file))) {
      print(fmt::format("==> {}\n{}", file.filename().string(), *log));
    }
  }
  return ExitCode::kSuccess;
}

}  // namespace

Subcommand declare_farm_status(CommandLine& farm) {
  CommandLine command =
      farm.subcommand("status", "report what is done, is running or failed, and why");
  auto options = std::make_shared<StatusOptions>();
  add_job_argument(command, options->job);
  command.flag("--watch", options->watch, "repeat until the job ends");
  command.option("--interval S", options->interval_s, "seconds between two reports (default: 5)")
      .range(0.1, 86400.0);
  command.flag("--all", options->all, "list all tasks, not only running and failed ones");
  command.flag("--json", options->json, "as JSON");
  command.option("--html HTML", options->html, "also write an HTML page");
  command.footer(
      "Exit codes: 0 done or running; 1 failed, cancelled, stopped or stalled; 3 ended, frames are "
      "missing;\n4 done, but some frames fall short.");
  return {command, [options](std::stop_token stop) { return show_status(*options, stop); }};
}

Subcommand declare_farm_retry(CommandLine& farm) {
  CommandLine command = farm.subcommand("retry", "render the missing frames of a job again");
  auto job = std::make_shared<std::string>(), frames = std::make_shared<std::string>();
  add_job_argument(command, *job);
  command.option("--frames RANGE", *frames,
                 "render these frames again, even complete ones (default: all\nincomplete frames)");
  return {command, [job, frames](std::stop_token stop) { return retry(*job, *frames, stop); }};
}

Subcommand declare_farm_cancel(CommandLine& farm) {
  CommandLine command = farm.subcommand("cancel", "cancel the queued and running tasks of a job");
  auto job = std::make_shared<std::string>();
  add_job_argument(command, *job);
  return {command, [job](std::stop_token /*stop*/) { return cancel(*job); }};
}

Subcommand declare_farm_logs(CommandLine& farm) {
  CommandLine command = farm.subcommand("logs", "print the logs of a frame, attempt by attempt");
  auto job = std::make_shared<std::string>();
  auto frame = std::make_shared<int>(0), attempt = std::make_shared<int>(0);
  add_job_argument(command, *job);
  command.option("FRAME", *frame, "a frame number").required();
  command.option("--attempt N", *attempt, "only this attempt (default: all)").range(1, 1000000);
  return {command, [job, frame, attempt](std::stop_token /*stop*/) {
            return show_logs(*job, *frame, *attempt);
          }};
}

}  // namespace raystage::cli
