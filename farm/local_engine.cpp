// SPDX-License-Identifier: Apache-2.0
#include "farm/local_engine.h"

#include <fmt/format.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <fstream>
#include <sstream>
#include <thread>

#include "base/atomic_file.h"
#include "base/resources.h"
#include "farm/task.h"
#include "farm/verification.h"

namespace raystage::farm {
namespace {

/// Returns the start time of a process (field 22 of /proc/PID/stat), which distinguishes it from
/// later processes with its number, or nothing if it does not exist.
std::string start_of_process(std::int64_t process) {
  std::ifstream file(fmt::format("/proc/{}/stat", process));
  std::string text;
  std::getline(file, text);
  const std::size_t name_end = text.rfind(')');
  if (name_end == std::string::npos) return "";
  std::istringstream fields(text.substr(name_end + 1));
  std::string field;
  for (int i = 3; i <= 22; ++i) fields >> field;
  return field;
}

class LocalRun {
 public:
  LocalRun(const JobFolder& folder, const LocalOptions& options, const std::stop_token& stop)
      : folder_(folder), options_(options), stop_(stop), job_(folder.job()) {}

  ExitCode run() {
    for (schemas::FarmRound round = folder_.rounds().back();;) {
      sign(round);
      run_round(round);
      if (stop_.stop_requested()) return stopped();
      run_task_of(schemas::FarmStage::kVerify, 0, round.round);
      if (stop_.stop_requested()) return stopped();
      const std::vector<schemas::FarmRound> rounds = folder_.rounds();
      if (rounds.back().round == round.round) break;
      round = rounds.back();
    }
    const std::optional<schemas::FarmEnd> end = folder_.end();
    if (!end || end->state != schemas::FarmEnd::State::kDone) {
      if (end)
        options_.on_message(
            fmt::format("missing frames: {}. {}", end->missing_frames, end->reason));
      return end && end->missing_frames.empty() ? ExitCode::kFailed : ExitCode::kSomeFramesFailed;
    }
    options_.progress(1);
    const ExitCode preview =
        job_.preview ? run_task_of(schemas::FarmStage::kPreview, 0, 1) : ExitCode::kSuccess;
    if (preview != ExitCode::kSuccess) return preview;
    if (!end->frames_below_coverage.empty()) {
      options_.on_message(
          fmt::format("frames below the least coverage: {}", end->frames_below_coverage));
    }
    if (!end->frames_with_rot.empty()) {
      options_.on_message(fmt::format("frames that lack cameras whose stored frames are rotten: {}",
                                      end->frames_with_rot));
    }
    if (end->frames_below_coverage.empty() && end->frames_with_rot.empty()) return preview;
    return ExitCode::kFellShort;
  }

 private:
  void sign(schemas::FarmRound& round) {
    round.host = host_name();
    round.process = getpid();
    round.process_start = start_of_process(round.process);
    write_file_atomically(folder_.round_file(round.round), schemas::format_farm_round(round));
  }

  void run_round(const schemas::FarmRound& round) {
    const double tasks = static_cast<double>(round.prepare.size() + round.render.size());
    double done = 0;
    const auto run_all = [&](schemas::FarmStage stage, const std::vector<int>& indices) {
      for (const int index : indices) {
        if (stop_.stop_requested()) return;
        run_task_of(stage, index, round.round,
                    [&](double part) { options_.progress(0.98 * (done + part) / tasks); });
        done += 1;
      }
    };
    run_all(schemas::FarmStage::kPrepare, round.prepare);
    run_all(schemas::FarmStage::kRender, round.render);
  }

  ExitCode run_task_of(
      schemas::FarmStage stage, int index, int round,
      std::function<void(double)> progress = [](double) {}) {
    TaskRequest request{folder_, stage, index, round};
    request.timeout_seconds = 0;  // this host wrote the frames
    request.progress = std::move(progress);
    request.on_message = options_.on_message;
    return run_task(request, stop_);
  }

  ExitCode stopped() {
    end_job(folder_, job_,
            {schemas::FarmEnd::State::kStopped, "the process that ran the job was stopped"});
    return ExitCode::kFailed;
  }

  const JobFolder& folder_;
  const LocalOptions& options_;
  const std::stop_token& stop_;
  const schemas::FarmJobDocument job_;
};

}  // namespace

ExitCode run_job_locally(const JobFolder& folder, const LocalOptions& options,
                         const std::stop_token& stop) {
  return LocalRun(folder, options, stop).run();
}

void stop_local_job(const JobFolder& folder) {
  constexpr int kMaxPolls = 600;
  constexpr std::chrono::milliseconds kBetweenLooks{100};
  for (const schemas::FarmRound& round : folder.rounds()) {
    if (round.host.empty()) continue;
    for (int looks = 0; is_local_job_running(round) != false; ++looks) {
      if (!is_local_job_running(round) || looks == kMaxPolls) {
        throw Error::failed("the job's process still runs", round.host, "Stop it on that host");
      }
      if (looks == 0) kill(static_cast<pid_t>(round.process), SIGTERM);
      std::this_thread::sleep_for(kBetweenLooks);
    }
  }
}

std::optional<bool> is_local_job_running(const schemas::FarmRound& round) {
  if (round.host.empty()) return false;
  if (round.host != host_name()) return std::nullopt;
  const std::string start = start_of_process(round.process);
  return !start.empty() && start == round.process_start;
}

}  // namespace raystage::farm
