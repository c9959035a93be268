// SPDX-License-Identifier: Apache-2.0
// Determines the status of a job and its tasks. Records in the job folder come first; the scheduler
// decides only about tasks without an end. Slurm's tasks are matched by array index plus the offset
// in JOB/slurm. Cost: linear in tasks and attempts.
#include "farm/status.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <map>

#include "base/atomic_file.h"
#include "base/number_text.h"
#include "compose/frame_range.h"
#include "compose/sequence_name.h"
#include "farm/local_engine.h"
#include "farm/rounds.h"

namespace raystage::farm {
namespace {

constexpr std::array<std::string_view, 7> kTaskNames{"waiting", "running",    "done",   "failed",
                                                     "lost",    "not queued", "unknown"};
constexpr std::array<std::string_view, 9> kJobNames{"waiting",   "running", "unknown",
                                                    "stalled",   "done",    "failed",
                                                    "cancelled", "stopped", "not queued"};
/// Slurm's reasons of pending tasks that will never start.
constexpr std::array<std::string_view, 2> kNeverStarts{"BadConstraints",
                                                       "DependencyNeverSatisfied"};
/// Slurm's reasons of pending tasks that need a person's action.
constexpr std::array<std::string_view, 10> kNeedsAttention{
    "ReqNodeNotAvail",    "PartitionDown",  "PartitionInactive", "PartitionNodeLimit",
    "PartitionTimeLimit", "InvalidAccount", "InvalidQOS",        "AccountNotAllowed",
    "QOSNotAllowed",      "JobHeld"};

template <std::size_t N>
bool is_one_of(const std::array<std::string_view, N>& reasons, std::string_view reason) {
  return std::ranges::any_of(reasons, [&](std::string_view r) { return reason.starts_with(r); });
}

bool is_over(const std::string& slurm_state) {
  constexpr std::array<std::string_view, 12> kLive{
      "PENDING",      "RUNNING",      "COMPLETING", "CONFIGURING", "SUSPENDED", "REQUEUED",
      "REQUEUE_HOLD", "SPECIAL_EXIT", "RESIZING",   "STAGE_OUT",   "SIGNALING", "STOPPED"};
  return std::ranges::find(kLive, slurm_state) == kLive.end();
}

/// Finds Slurm's tasks by stage and index. An index is the array index plus the array's offset,
/// which JOB/slurm has for each array id.
class QueuedTasks {
 public:
  QueuedTasks(const JobFolder& folder, const SchedulerAnswer& answer) {
    if (!answer.tasks) return;
    for (const auto& [name, task] : *answer.tasks) {
      const std::size_t underscore = name.find('_');
      int index = 0;
      if (underscore != std::string::npos) {
        index = number_at_start(name.substr(underscore + 1)) +
                offset_of(folder, name.substr(0, underscore));
      }
      // Prefer tasks that are not over, then the newest.
      const auto key = std::pair(task.stage, index);
      const auto [known, is_new] = tasks_.emplace(key, &task);
      if (!is_new && (is_over(known->second->state) || !is_over(task.state))) known->second = &task;
    }
  }
  const SlurmTask* find(const std::string& stage, int index) const {
    const auto found = tasks_.find({stage, index});
    return found == tasks_.end() ? nullptr : found->second;
  }

 private:
  /// Reads the offset of an array that the round's script wrote to JOB/slurm/offset.ID.
  int offset_of(const JobFolder& folder, const std::string& array) {
    const auto [known, is_new] = offsets_.emplace(array, 0);
    if (!is_new) return known->second;
    const auto text = read_record(folder.contained(folder.slurm_ids() / ("offset." + array)));
    return known->second = number_at_start(text.value_or(""));
  }

  std::map<std::pair<std::string, int>, const SlurmTask*> tasks_;
  std::map<std::string, int> offsets_;
};

int percent_of(const JobFolder& folder, const std::string& stage, int index) {
  const auto text =
      read_record(folder.contained(folder.progress() / fmt::format("{}.{:04}", stage, index)));
  return std::clamp(number_at_start(text.value_or("")), 0, 100);
}

/// Sets the state of a task without attempts, or whose last attempt has no end.
void ask_scheduler(const SchedulerAnswer& answer, const SlurmTask* slurm, bool has_started,
                   bool job_is_over, schemas::FarmJobDocument::Engine engine, TaskStatus& task) {
  if (job_is_over) {
    task.state = has_started ? TaskState::kLost : TaskState::kNotQueued;
    return;
  }
  if (engine == schemas::FarmJobDocument::Engine::kLocal) {
    task.state = !answer.is_local_job_running                  ? TaskState::kUnknown
                 : has_started && *answer.is_local_job_running ? TaskState::kRunning
                 : *answer.is_local_job_running                ? TaskState::kWaiting
                 : has_started                                 ? TaskState::kLost
                                                               : TaskState::kNotQueued;
    return;
  }
  if (!answer.tasks) {
    task.state = TaskState::kUnknown;
    return;
  }
  if (slurm == nullptr) {
    task.state = has_started ? TaskState::kLost : TaskState::kNotQueued;
    return;
  }
  if (slurm->state == "RUNNING" || slurm->state == "COMPLETING") {
    task.state = TaskState::kRunning;
    task.node = slurm->node;
  } else if (is_over(slurm->state)) {
    task.state = has_started ? TaskState::kLost : TaskState::kFailed;
    task.reason = "Slurm: " + slurm->state;
  } else {
    task.state = TaskState::kWaiting;
    task.reason = slurm->reason;
  }
}

bool is_done(const JobFolder& folder) {
  const std::optional<schemas::FarmEnd> end = folder.end();
  return end && end->state == schemas::FarmEnd::State::kDone;
}

TaskStatus status_of(const JobFolder& folder, const SchedulerAnswer& answer,
                     const QueuedTasks& queued, const TaskAttempts& attempts, bool job_is_over,
                     const schemas::FarmJobDocument& job, const std::string& stage, int index) {
  TaskStatus task;
  task.stage = stage;
  task.index = index;
  if (stage == "preview" && is_done(folder)) job_is_over = false;  // previews run after the end
  if (stage == "render") task.frames = job.chunks[index].frames;
  if (const auto found = attempts.find({stage, index}); found != attempts.end()) {
    task.attempts = found->second;
  }
  const schemas::FarmAttempt* last = task.attempts.empty() ? nullptr : &task.attempts.back();
  if (last != nullptr) task.node = last->node;
  if (last != nullptr && last->end) {
    task.reason = last->end->reason;
    task.state =
        last->end->result == schemas::AttemptResult::kDone ? TaskState::kDone : TaskState::kFailed;
    const SlurmTask* slurm = queued.find(stage, index);
    // A task that is queued again waits, whatever the result of its last attempt.
    if (slurm != nullptr && !job_is_over && slurm->state == "PENDING") {
      task.state = TaskState::kWaiting;
    }
    return task;
  }
  ask_scheduler(answer, queued.find(stage, index), last != nullptr, job_is_over, job.engine, task);
  if (task.state == TaskState::kRunning) task.percent = percent_of(folder, stage, index);
  return task;
}

void count_frames(JobStatus& status) {
  double seconds = 0, frames_timed = 0, running = 0;
  double left = 0;
  for (const TaskStatus& task : status.tasks) {
    for (const schemas::FarmAttempt& attempt : task.attempts) {
      if (!attempt.end) continue;
      status.cpu_seconds += attempt.end->cpu_seconds;
      status.light_field_frames_estimated += attempt.end->light_field_frames_estimated;
    }
    if (task.stage != "render") continue;
    const auto own = static_cast<std::int64_t>(compose::parse_frame_range(task.frames).size());
    status.frames += own;
    if (task.state == TaskState::kDone) {
      status.frames_done += own;
      seconds += task.attempts.back().end->wall_seconds;
      frames_timed += static_cast<double>(own);
      continue;
    }
    if (task.state == TaskState::kFailed) {
      // A task that Slurm could not start has left no record.
      const bool has_end = !task.attempts.empty() && task.attempts.back().end;
      const std::string failed_frames =
          has_end ? task.attempts.back().end->failed_frames : std::string();
      const std::int64_t failed =
          failed_frames.empty() ? own : std::min(own, compose::frame_range_size(failed_frames));
      status.frames_failed += failed;
      status.frames_done += own - failed;
    }
    const auto frames = static_cast<double>(own);
    const double done = task.state == TaskState::kRunning ? frames * task.percent / 100.0 : 0;
    if (task.state == TaskState::kRunning) ++running;
    left += frames - done;
  }
  if (status.is_live() && running > 0 && frames_timed > 0 && seconds > 0) {
    status.seconds_left = left * seconds / frames_timed / running;
  }
}

JobState state_of_end(const schemas::FarmEnd& end) {
  switch (end.state) {
    case schemas::FarmEnd::State::kDone:
      return JobState::kDone;
    case schemas::FarmEnd::State::kFailed:
      return JobState::kFailed;
    case schemas::FarmEnd::State::kCancelled:
      return JobState::kCancelled;
    case schemas::FarmEnd::State::kStopped:
      break;
  }
  return JobState::kStopped;
}

bool has_begun(const JobStatus& status) {
  return std::ranges::any_of(status.tasks, [](const TaskStatus& task) {
    return !task.attempts.empty() && task.stage != "measure";
  });
}

JobState state_of_local_job(const SchedulerAnswer& answer, JobStatus& status) {
  if (!answer.is_local_job_running) {
    status.reason = "it runs on another host: query its status there";
    return JobState::kUnknown;
  }
  if (*answer.is_local_job_running) return JobState::kRunning;
  if (!has_begun(status)) {
    status.reason = "`raystage farm retry` starts it";
    return JobState::kNotQueued;
  }
  status.reason = "the process that ran it is gone; `raystage farm retry` continues the job";
  return JobState::kStalled;
}

/// Determines the state of a job without an end from its tasks in Slurm's queue.
JobState state_of_queued_job(const JobFolder& folder, const std::map<std::string, SlurmTask>& tasks,
                             JobStatus& status) {
  bool runs = false, waits = false;
  std::string waits_for, never_starts, needs_attention;
  for (const auto& [name, task] : tasks) {
    if (task.stage == "preview" || is_over(task.state)) continue;
    if (task.state != "PENDING") {
      runs = true;
      continue;
    }
    waits = true;
    if (task.stage == "start") waits_for = "it waits for the job before it";
    if (is_one_of(kNeverStarts, task.reason)) never_starts = task.reason;
    if (is_one_of(kNeedsAttention, task.reason)) needs_attention = task.reason;
  }
  if (runs) return JobState::kRunning;
  if (!never_starts.empty()) {
    status.reason =
        fmt::format("Slurm can never start what is queued: {}; cancel the job", never_starts);
    return JobState::kStalled;
  }
  status.reason = needs_attention.empty()
                      ? waits_for
                      : fmt::format("Slurm starts nothing: {}", needs_attention);
  if (waits) return has_begun(status) ? JobState::kRunning : JobState::kWaiting;
  std::error_code ignored;
  if (!has_begun(status) && std::filesystem::is_empty(folder.slurm_ids(), ignored)) {
    status.reason = "sh round-1.sh in the job folder queues it";
    return JobState::kNotQueued;
  }
  status.reason =
      "nothing is queued, and the job has no end: see logs/slurm.*.log; `raystage farm retry` "
      "continues it";
  return JobState::kStalled;
}

JobState state_of(const JobFolder& folder, const SchedulerAnswer& answer, JobStatus& status) {
  if (const auto end = folder.end()) {
    status.reason = end->reason;
    status.missing_frames = end->missing_frames;
    status.frames_below_coverage = end->frames_below_coverage;
    status.frames_with_rot = end->frames_with_rot;
    return state_of_end(*end);
  }
  switch (status.job.engine) {
    case schemas::FarmJobDocument::Engine::kLocal:
      return state_of_local_job(answer, status);
    case schemas::FarmJobDocument::Engine::kOpenJd:
      status.reason = "a render manager runs it: query that for waiting and running tasks";
      return has_begun(status) ? JobState::kUnknown : JobState::kWaiting;
    case schemas::FarmJobDocument::Engine::kSlurm:
      break;
  }
  if (!answer.tasks) {
    status.reason = "the Slurm controller does not answer; only ended tasks are known";
    return JobState::kUnknown;
  }
  return state_of_queued_job(folder, *answer.tasks, status);
}

/// Reports frames of a finished job that were deleted or moved since.
void find_removed_frames(const JobFolder& folder, JobStatus& status) {
  if (status.state != JobState::kDone) return;
  const schemas::FarmJobDocument here = folder.local_job();
  const compose::SequenceName name(here.output);
  std::vector<int> gone;
  for (const int frame : job_frames(here)) {
    if (!file_exists(name.path(frame))) gone.push_back(frame);
  }
  if (gone.empty()) return;
  status.missing_frames = compose::format_frame_range(gone);
  status.reason = "frames have been removed since; `raystage farm retry` renders them again";
}

}  // namespace

std::string_view task_state_name(TaskState state) {
  return kTaskNames[static_cast<std::size_t>(state)];
}
std::string_view job_state_name(JobState state) {
  return kJobNames[static_cast<std::size_t>(state)];
}

bool JobStatus::is_live() const {
  return state == JobState::kWaiting || state == JobState::kRunning || state == JobState::kUnknown;
}

bool JobStatus::is_preview_running() const {
  return state == JobState::kDone && std::ranges::any_of(tasks, [](const TaskStatus& task) {
           return task.stage == "preview" &&
                  (task.state == TaskState::kWaiting || task.state == TaskState::kRunning);
         });
}

JobStatus job_status(const JobFolder& folder, const SchedulerAnswer& answer) {
  JobStatus status;
  status.job = folder.job();
  status.excluded_nodes = folder.excluded_nodes();
  status.rounds = static_cast<int>(folder.rounds().size());
  // Read before the attempts: if the job ends in between, its attempts are complete.
  const bool is_over = file_exists(folder.end_file());
  const TaskAttempts attempts = read_attempts(folder);
  const QueuedTasks queued(folder, answer);
  const auto add = [&](const std::string& stage, std::size_t count) {
    for (std::size_t i = 0; i < count; ++i) {
      status.tasks.push_back(status_of(folder, answer, queued, attempts, is_over, status.job, stage,
                                       static_cast<int>(i)));
    }
  };
  if (attempts.contains({"measure", 0})) add("measure", 1);
  add("prepare", status.job.instants.size());
  add("render", status.job.chunks.size());
  add("verify", 1);
  if (status.job.preview) add("preview", 1);
  status.state = state_of(folder, answer, status);
  find_removed_frames(folder, status);
  count_frames(status);
  if (!status.missing_frames.empty()) {  // the verification overrides the tasks' reports
    const std::int64_t missing = compose::frame_range_size(status.missing_frames);
    status.frames_failed = status.state == JobState::kDone ? 0 : missing;  // else removed since
    status.frames_done = status.frames - missing;
  }
  return status;
}

JobStatus job_status(const JobFolder& folder) {
  SchedulerAnswer answer;
  const schemas::FarmJobDocument job = folder.job();
  const std::optional<schemas::FarmEnd> end = folder.end();
  // A finished job may still make its preview.
  if (end && !(job.preview && end->state == schemas::FarmEnd::State::kDone)) {
    return job_status(folder, answer);
  }
  if (job.engine == schemas::FarmJobDocument::Engine::kSlurm) answer.tasks = slurm_tasks(job);
  if (job.engine == schemas::FarmJobDocument::Engine::kLocal) {
    answer.is_local_job_running = false;  // if it was never started
    for (const schemas::FarmRound& round : folder.rounds()) {
      if (!round.host.empty()) answer.is_local_job_running = is_local_job_running(round);
    }
  }
  return job_status(folder, answer);
}

}  // namespace raystage::farm
