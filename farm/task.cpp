// SPDX-License-Identifier: Apache-2.0
// Runs one attempt at a task: records its start, checks the node, runs the command or the
// verification, and records the end. After a failure the node is checked again: the cause may be a
// fault of the node, such as a full disk.
#include "farm/task.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>
#include <xxhash.h>

#include <algorithm>
#include <csignal>
#include <cstdlib>
#include <iterator>
#include <set>

#include "base/atomic_file.h"
#include "base/child_process.h"
#include "base/number_text.h"
#include "base/posix_file.h"
#include "compose/frame_range.h"
#include "farm/attempts.h"
#include "farm/node_checks.h"
#include "farm/render_log_parser.h"
#include "farm/rounds.h"
#include "farm/task_commands.h"
#include "farm/verification.h"

namespace raystage::farm {
namespace {

constexpr int kOutOfMemory = 33;  // exit code, as render farms agreed on
constexpr std::size_t kMaxNodeFailures = 2;

std::string environment(const char* name) {
  const char* value = std::getenv(name);
  return value == nullptr ? "" : value;
}

/// Returns the task's round. A task that is started by hand may have no written round.
schemas::FarmRound round_of(const TaskRequest& request) {
  const std::filesystem::path file = request.folder.round_file(request.round);
  const auto text = read_record(request.folder.contained(file));
  return text ? schemas::parse_farm_round(*text, file.string()) : schemas::FarmRound{};
}

/// Returns the frames of a task of stage render: its whole chunk, or those to render again.
std::string frames_of_task(const std::string& chunk, const schemas::FarmRound& round) {
  if (round.frames.empty()) return chunk;
  std::vector<int> frames;
  std::ranges::set_intersection(compose::parse_frame_range(chunk),
                                compose::parse_frame_range(round.frames),
                                std::back_inserter(frames));
  return compose::format_frame_range(frames);
}

schemas::FarmAttempt new_attempt(const TaskRequest& request, const schemas::FarmJobDocument& job,
                                 const schemas::FarmRound& round) {
  schemas::FarmAttempt attempt;
  attempt.stage = schemas::farm_stage_name(request.stage);
  attempt.index = request.index;
  attempt.round = request.round;
  attempt.node = request.node.empty() ? node_name() : request.node;
  attempt.process = getpid();
  const std::string array = environment("SLURM_ARRAY_JOB_ID");
  attempt.slurm_task = array.empty() ? environment("SLURM_JOB_ID")
                                     : array + "_" + environment("SLURM_ARRAY_TASK_ID");
  attempt.restart = number_at_start(environment("SLURM_RESTART_COUNT"));
  attempt.build = job.build;
  attempt.started_utc = utc_now();
  if (request.stage == schemas::FarmStage::kRender) {
    attempt.frames = frames_of_task(job.chunks[request.index].frames, round);
  }
  return attempt;
}

void check_index(const TaskRequest& request, const schemas::FarmJobDocument& job) {
  const std::size_t tasks = request.stage == schemas::FarmStage::kPrepare  ? job.instants.size()
                            : request.stage == schemas::FarmStage::kRender ? job.chunks.size()
                                                                           : 1;
  if (request.index >= 0 && static_cast<std::size_t>(request.index) < tasks) return;
  throw Error::bad_input(fmt::format("stage {} has {} tasks, there is no task {}",
                                     schemas::farm_stage_name(request.stage), tasks, request.index),
                         request.folder.job_file().string(), "Use an index from 0");
}

/// Writes the command's progress for `status` to a small file, at most once per percent.
class ProgressFile {
 public:
  ProgressFile(const TaskRequest& request, const schemas::FarmAttempt& attempt)
      : request_(request),
        file_(request.folder.progress() / fmt::format("{}.{:04}", attempt.stage, attempt.index)) {}

  void parse_line(std::string_view line) {
    constexpr std::string_view kBegin = "Progress: ";
    if (line.starts_with(kBegin)) report(number_at_start(line.substr(kBegin.size())));
  }
  void report(int percent) {
    if (percent <= percent_) return;
    percent_ = percent;
    write(fmt::format("{}\n", percent));
    request_.progress(percent / 100.0);
  }

 private:
  /// Fails silently: only `status` reads it. Links, pipes and devices are left alone.
  void write(const std::string& text) const {
    constexpr int kFlags = O_WRONLY | O_CREAT | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK;
    const FileDescriptor file(::open(file_.c_str(), kFlags, 0666));
    struct stat status {};
    if (!file.open() || fstat(file.number(), &status) != 0 || !S_ISREG(status.st_mode)) return;
    if (ftruncate(file.number(), 0) != 0) return;
    [[maybe_unused]] const ssize_t written = ::write(file.number(), text.data(), text.size());
  }

  const TaskRequest& request_;
  std::filesystem::path file_;
  int percent_ = -1;
};

/// Returns whether all frames are complete. The verification reports those that fall short.
bool is_complete(const ChildResult& child) {
  return child.exit_code == 0 || child.exit_code == static_cast<int>(ExitCode::kFellShort);
}

schemas::AttemptResult result_of(const ChildResult& child, bool stopped) {
  if (is_complete(child)) return schemas::AttemptResult::kDone;
  if (stopped) return schemas::AttemptResult::kStopped;
  if (child.exit_code == 2) return schemas::AttemptResult::kBadInput;
  // The kernel kills processes that exceed their memory.
  if (child.exit_code == kOutOfMemory || child.signal == SIGKILL) {
    return schemas::AttemptResult::kOutOfMemory;
  }
  return child.signal == SIGTERM || child.exit_code == 128 + SIGTERM
             ? schemas::AttemptResult::kStopped
             : schemas::AttemptResult::kFailed;
}

std::string reason_of(schemas::AttemptResult result, const RenderLogParser& log, bool stopped) {
  switch (result) {
    case schemas::AttemptResult::kDone:
      return "";
    case schemas::AttemptResult::kStopped:
      return stopped ? "stopped by a signal: time limit, preemption or cancellation"
                     : "the command was stopped by a signal";
    case schemas::AttemptResult::kOutOfMemory:
      return "out of memory";
    default:
      return log.reason();
  }
}

/// Returns the number of tasks that failed by themselves on this node since the last retry. A task
/// counts once: repeated failures of one task do not indicate a faulty node.
std::size_t failures_on(const JobFolder& folder, const std::string& node) {
  std::set<std::pair<std::string, int>> failed_tasks;
  int first_round = 1;
  for (const schemas::FarmRound& round : folder.rounds()) {
    if (round.fresh) first_round = round.round;
  }
  for (const auto& [task, attempts] : read_attempts(folder)) {
    for (const schemas::FarmAttempt& attempt : attempts) {
      const bool failed = attempt.end && attempt.end->result == schemas::AttemptResult::kFailed;
      const bool counts = failed && attempt.node == node && attempt.round >= first_round;
      if (counts && task.first != "verify") failed_tasks.insert(task);
    }
  }
  return failed_tasks.size();
}

std::vector<std::string> command_of(const TaskRequest& request, const MappedJob& mapped,
                                    const schemas::FarmRound& round,
                                    const schemas::FarmAttempt& attempt) {
  const schemas::FarmJobDocument& job = mapped.job;
  switch (request.stage) {
    case schemas::FarmStage::kPrepare:
      return prepare_command(job, mapped.shot, request.index, round.memory_factor);
    case schemas::FarmStage::kRender:
      return render_command(job, mapped.shot, request.index, attempt.frames,
                            round.frames.empty() ? job.existing : "overwrite", round.memory_factor);
    default:
      return preview_command(job, request.folder);
  }
}

/// One attempt at a task. The constructor records its start.
class Attempt {
 public:
  Attempt(const TaskRequest& request, const MappedJob& mapped)
      : request_(request),
        mapped_(mapped),
        round_(round_of(request)),
        attempt_(new_attempt(request, mapped.job, round_)) {
    record_attempt_start(request.folder, attempt_);
    request.on_message(fmt::format("{} on {}", attempt_name(attempt_), attempt_.node));
  }

  ExitCode run(const std::stop_token& stop) {
    schemas::FarmAttempt::End end = declined_or_run(stop);
    end.ended_utc = utc_now();
    attempt_.end = end;
    // Exclude the node before the record is written, so that readers of the record see both.
    if (end.node_fault) request_.folder.exclude(attempt_.node, end.reason);
    record_attempt_end(request_.folder, attempt_);
    if (end.result == schemas::AttemptResult::kFailed && !end.node_fault &&
        request_.stage != schemas::FarmStage::kVerify &&
        mapped_.job.engine !=
            schemas::FarmJobDocument::Engine::kLocal &&  // these have no other node
        !mapped_.job.distributed &&
        failures_on(request_.folder, attempt_.node) >= kMaxNodeFailures) {
      request_.folder.exclude(attempt_.node, fmt::format("{} tasks failed here, the last: {}",
                                                         kMaxNodeFailures, end.reason));
    }
    if (!end.reason.empty()) request_.on_message(end.reason);
    // The exit code of the command, including 33 (out of memory) and 128 + n (signal n).
    return static_cast<ExitCode>(end.exit_code);
  }

 private:
  static schemas::FarmAttempt::End ended(schemas::AttemptResult result, std::string reason) {
    schemas::FarmAttempt::End end;
    end.result = result;
    end.reason = std::move(reason);
    return end;
  }

  schemas::FarmAttempt::End declined_or_run(const std::stop_token& stop) {
    if (file_exists(request_.folder.cancel_file())) {
      if (request_.stage == schemas::FarmStage::kVerify && !request_.folder.end()) {
        // The cancelling process may not have reached the scheduler.
        end_job(request_.folder, mapped_.job, {schemas::FarmEnd::State::kCancelled});
      }
      return ended(schemas::AttemptResult::kDeclined, "the job was cancelled");
    }
    const bool uses_node = request_.stage == schemas::FarmStage::kPrepare ||
                           request_.stage == schemas::FarmStage::kRender;
    if (uses_node) {
      if (auto declined = declined_by_node()) return *declined;
    }
    if (request_.stage == schemas::FarmStage::kRender && lacks_an_instant()) {
      return ended(schemas::AttemptResult::kDeclined,
                   "a light field frame could not be prepared; the next round tries again");
    }
    return request_.stage == schemas::FarmStage::kVerify ? verify(stop) : run_command(stop);
  }

  /// Returns the end of the attempt if the node is excluded or has a fault. Simultaneous tasks
  /// check the node in turn: the first one excludes it, and only that one loses an attempt.
  std::optional<schemas::FarmAttempt::End> declined_by_node() const {
    const NodeLock turn(request_.folder, attempt_.node);
    if (request_.folder.is_excluded(attempt_.node)) {
      return ended(schemas::AttemptResult::kDeclined, "this node is excluded from the job");
    }
    std::optional<std::string> fault = node_fault(mapped_.job, request_.folder.path());
    if (!fault) return std::nullopt;
    // Only the job's nodes have the archives: no other node could run the task.
    if (mapped_.job.distributed) return ended(schemas::AttemptResult::kFailed, std::move(*fault));
    request_.folder.exclude(attempt_.node, *fault);
    schemas::FarmAttempt::End end = ended(schemas::AttemptResult::kDeclined, std::move(*fault));
    end.node_fault = true;
    return end;
  }

  /// Returns whether the next round will prepare an instant of this chunk again.
  bool lacks_an_instant() const {
    const auto& instants = mapped_.job.chunks[request_.index].instants;
    if (instants.empty()) return false;
    const TaskAttempts attempts = read_attempts(request_.folder);
    return std::ranges::any_of(instants, [&](int instant) {
      const auto found = attempts.find({"prepare", instant});
      return found != attempts.end() && !needs_no_preparation(found->second) &&
             !file_exists(mapped_.job.instants[instant].file);
    });
  }

  schemas::FarmAttempt::End verify(const std::stop_token& stop) {
    ProgressFile progress(request_, attempt_);
    VerificationRequest request{
        request_.folder,
        mapped_.job,
        mapped_.shot,
        request_.round,
        request_.timeout_seconds,
        [&](double done) { progress.report(static_cast<int>(100 * done)); }};
    return verify_job(request, stop);
  }

  schemas::FarmAttempt::End run_command(const std::stop_token& stop) {
    ProgressFile progress(request_, attempt_);
    RenderLogParser log;
    ChildOptions options;
    options.log = attempt_log(request_.folder, attempt_);
    options.stop = stop;
    options.line = [&](std::string_view line) {
      progress.parse_line(line);
      log.parse_line(line);
    };
    // Record the stop at once: the node may be killed before the frames in flight are complete.
    const std::stop_callback record_stop(stop, [&] {
      schemas::FarmAttempt stopped = attempt_;
      stopped.end = ended(schemas::AttemptResult::kStopped,
                          reason_of(schemas::AttemptResult::kStopped, {}, true));
      stopped.end->ended_utc = utc_now();
      try {
        record_attempt_end(request_.folder, stopped);
      } catch (const Error&) {  // the end of the command is recorded later
      }
    });
    const ChildResult child = run_child(command_of(request_, mapped_, round_, attempt_), options);
    schemas::FarmAttempt::End end;
    end.result = result_of(child, stop.stop_requested());
    const bool ended_itself = child.exit_code == static_cast<int>(ExitCode::kSomeFramesFailed);
    if (ended_itself && end.result == schemas::AttemptResult::kFailed && log.has_only_rot()) {
      end.result = schemas::AttemptResult::kBadInput;  // every other attempt would fail likewise
    }
    end.exit_code = is_complete(child) ? 0 : child.exit_code;
    end.reason = reason_of(end.result, log, stop.stop_requested());
    end.wall_seconds = child.wall_seconds;
    end.cpu_seconds = child.cpu_seconds;
    end.peak_memory_bytes = child.peak_memory_bytes;
    end.failed_frames = compose::format_frame_range(
        std::vector<int>(log.failed_frames.begin(), log.failed_frames.end()));
    end.light_field_frames_estimated = log.solved;
    end.light_field_frames_loaded = log.read;
    end.rendering = log.rendering;
    const bool may_be_the_node = end.result == schemas::AttemptResult::kFailed ||
                                 end.result == schemas::AttemptResult::kBadInput;
    if (may_be_the_node && request_.stage != schemas::FarmStage::kPreview) {
      // The cause may be a fault of the node, e.g. a full disk or a lost mount.
      if (auto fault = node_fault(mapped_.job, request_.folder.path())) {
        end.result = schemas::AttemptResult::kFailed;
        end.reason = std::move(*fault);
        end.node_fault = true;
      }
    }
    return end;
  }

  const TaskRequest& request_;
  const MappedJob& mapped_;
  const schemas::FarmRound round_;
  schemas::FarmAttempt attempt_;
};

}  // namespace

MappedJob read_mapped_job(const JobFolder& folder, std::span<const PathMappingRule> rules) {
  MappedJob mapped{folder.job(), folder.shot_file()};
  if (rules.empty()) return mapped;
  map_paths(mapped.job, rules);
  const std::string before = read_file(folder.shot_file());
  const std::string after = map_shot_paths(before, folder.shot_file().string(), rules);
  // The name has a hash of the content, so that tasks with other rules use other files.
  mapped.shot =
      folder.path() / fmt::format("shot.{:016x}.json", XXH3_64bits(after.data(), after.size()));
  if (!file_exists(mapped.shot)) write_file_atomically(mapped.shot, after);
  return mapped;
}

MappedJob read_local_job(const JobFolder& folder) {
  return read_mapped_job(folder, local_path_rules(folder.job(), folder.path()));
}

ExitCode run_task(const TaskRequest& request, const std::stop_token& stop) {
  const MappedJob mapped = read_mapped_job(request.folder, request.paths);
  check_index(request, mapped.job);
  if (mapped.job.umask) umask(static_cast<mode_t>(*mapped.job.umask));
  return Attempt(request, mapped).run(stop);
}

}  // namespace raystage::farm
