// SPDX-License-Identifier: Apache-2.0
// raystage farm status, retry, cancel, logs: what one does with a job.
#include <fmt/format.h>
#include <unistd.h>

#include <chrono>
#include <cstdio>
#include <memory>
#include <thread>

#include "base/atomic_file.h"
#include "cli/farm.h"
#include "compose/frame_range.h"
#include "farm/local_engine.h"
#include "farm/retry.h"
#include "farm/rounds.h"
#include "farm/slurm_queue.h"
#include "farm/status.h"
#include "farm/verification.h"

namespace raystage {
namespace {

struct StatusOptions {
  std::string job, html;
  bool watch = false, json = false, all = false;
  double interval_s = 5;
};

/// As the job's end: 0 done or under way, 3 frames missing, 1 otherwise.
ExitCode exit_code_of(const farm::JobStatus& status) {
  switch (status.state) {
    case farm::JobState::kFailed:
      return status.missing_frames.empty() ? ExitCode::kFailed : ExitCode::kSomeFramesFailed;
    case farm::JobState::kStalled:
    case farm::JobState::kCancelled:
    case farm::JobState::kStopped:
      return ExitCode::kFailed;
    case farm::JobState::kDone:
      return status.missing_frames.empty() ? ExitCode::kSuccess : ExitCode::kSomeFramesFailed;
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
    if (redraw) print("\033[H\033[2J");
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
  if (!frames.empty()) wanted = parse_frame_range(frames);
  const FarmRound round = farm::write_retry_round(folder, wanted, stop);
  print(fmt::format("round {}: {} tasks to render, {} to prepare\n", round.round,
                    round.render.size(), round.prepare.size()));
  std::fflush(stdout);
  switch (folder.job().engine) {
    case FarmJobDocument::Engine::kSlurm:
      farm::queue_round(folder, round);
      return ExitCode::kSuccess;
    case FarmJobDocument::Engine::kLocal: {
      Progress progress;
      farm::LocalOptions local;
      local.progress = [&](double done) { progress.report(done); };
      local.on_message = [&](std::string_view line) { progress.say(line); };
      return farm::run_job_locally(folder, local, stop);
    }
    default:
      print(fmt::format("the render manager has to run these tasks again, with --round {}\n",
                        round.round));
      return ExitCode::kSuccess;
  }
}

ExitCode cancel(const std::string& job_name) {
  const farm::JobFolder folder = farm::find_job(job_name);
  const FarmJobDocument job = folder.local_job();
  if (const auto end = folder.end()) {
    throw Error::bad_input("the job is over: it is " + std::string(farm_end_state_name(end->state)),
                           folder.path().string(), "Nothing is left to cancel");
  }
  // First of all: a verification that ends now must queue nothing more.
  write_file_atomically(folder.cancel_file(), "");
  if (job.engine == FarmJobDocument::Engine::kSlurm) farm::cancel_slurm_job(job);
  if (job.engine == FarmJobDocument::Engine::kLocal) farm::stop_local_job(folder);
  FarmEnd end;
  end.state = FarmEnd::State::kCancelled;
  end.frames = static_cast<int>(farm::job_frames(job).size());
  farm::end_job(folder, job, end);
  print(fmt::format("job {} is cancelled; frames that are there stay\n", job.id));
  return ExitCode::kSuccess;
}

ExitCode show_logs(const std::string& job_name, int frame, int only_attempt) {
  const farm::JobFolder folder = farm::find_job(job_name);
  const FarmJobDocument job = folder.job();
  const std::vector<int> wanted{frame};
  const std::vector<int> chunks = farm::chunks_with_frames(job, wanted);
  if (chunks.empty()) {
    throw Error::bad_input(fmt::format("frame {} is not in the job, which has {}", frame,
                                       format_frame_range(farm::job_frames(job))),
                           folder.path().string(), "Name a frame of the job");
  }
  const farm::TaskAttempts attempts = farm::read_attempts(folder);
  bool any = false;
  const auto show = [&](const std::string& stage, int index) {
    const auto found = attempts.find({stage, index});
    if (found == attempts.end()) return;
    for (const FarmAttempt& attempt : found->second) {
      if (only_attempt > 0 && attempt.attempt != only_attempt) continue;
      any = true;
      print(fmt::format(
          "==> {} on {}, started {}: {}\n", farm::attempt_name(attempt), attempt.node,
          format_utc(attempt.started_utc),
          attempt.end ? fmt::format("{}{}{}", attempt_result_name(attempt.end->result),
                                    attempt.end->reason.empty() ? "" : ": ", attempt.end->reason)
                      : "no end is recorded"));
      if (const auto log = farm::read_record(farm::attempt_log(folder, attempt))) print(*log);
    }
  };
  for (const int chunk : chunks) {
    for (const int instant : job.chunks[static_cast<std::size_t>(chunk)].instants) {
      show("prepare", instant);
    }
    show("render", chunk);
  }
  if (!any && only_attempt > 0) {
    throw Error::bad_input(fmt::format("there is no attempt {} at frame {}", only_attempt, frame),
                           folder.path().string(), "Leave --attempt out to see all");
  }
  if (any) return ExitCode::kSuccess;
  print(fmt::format("no attempt at frame {} has started\n", frame));
  for (const int chunk : chunks) {  // what the shell said of a command that it could not start
    const auto file = folder.logs() / fmt::format("slurm.render.{}.log", chunk);
    if (const auto log = farm::read_record(file)) {
      print(fmt::format("==> {}\n{}", file.filename().string(), *log));
    }
  }
  return ExitCode::kSuccess;
}

}  // namespace

FarmCommand declare_farm_status(CLI::App& farm) {
  CLI::App* app = farm.add_subcommand("status", "report what is done, runs, failed, and why");
  auto options = std::make_shared<StatusOptions>();
  add_job_argument(*app, options->job);
  app->add_flag("--watch", options->watch, "repeat until the job is over");
  app->add_option("--interval", options->interval_s, "seconds between two looks (default: 5)")
      ->check(CLI::Range(0.1, 86400.0))
      ->type_name("S");
  app->add_flag("--all", options->all, "a line for every task, not only those that run or failed");
  app->add_flag("--json", options->json, "as JSON");
  app->add_option("--html", options->html, "write a page, in addition")->type_name("HTML");
  app->footer(
      "Exit codes: 0 done or under way; 1 failed, cancelled, stopped or stalled; 3 over, and "
      "frames "
      "are missing.");
  return {app, [options](std::stop_token stop) { return show_status(*options, stop); }};
}

FarmCommand declare_farm_retry(CLI::App& farm) {
  CLI::App* app = farm.add_subcommand("retry", "try the missing frames of a job again");
  auto job = std::make_shared<std::string>(), frames = std::make_shared<std::string>();
  add_job_argument(*app, *job);
  app->add_option("--frames", *frames,
                  "render these frames anew, whole or not (default: all that\nare not whole)")
      ->type_name("RANGE");
  return {app, [job, frames](std::stop_token stop) { return retry(*job, *frames, stop); }};
}

FarmCommand declare_farm_cancel(CLI::App& farm) {
  CLI::App* app = farm.add_subcommand("cancel", "cancel what waits or runs");
  auto job = std::make_shared<std::string>();
  add_job_argument(*app, *job);
  return {app, [job](std::stop_token /*stop*/) { return cancel(*job); }};
}

FarmCommand declare_farm_logs(CLI::App& farm) {
  CLI::App* app = farm.add_subcommand("logs", "print the logs of a frame, attempt by attempt");
  auto job = std::make_shared<std::string>();
  auto frame = std::make_shared<int>(0), attempt = std::make_shared<int>(0);
  add_job_argument(*app, *job);
  app->add_option("FRAME", *frame, "a frame number")->required();
  app->add_option("--attempt", *attempt, "only this attempt (default: all)")
      ->check(CLI::Range(1, 1000000))
      ->type_name("N");
  return {app, [job, frame, attempt](std::stop_token /*stop*/) {
            return show_logs(*job, *frame, *attempt);
          }};
}

}  // namespace raystage
