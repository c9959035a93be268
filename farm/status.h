// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "farm/job_folder.h"
#include "farm/slurm_queue.h"

namespace raystage::farm {

/// The state of a task. Ended tasks are known from their records; only the scheduler has the state
/// of other tasks.
enum class TaskState {
  kWaiting,  ///< queued
  kRunning,
  kDone,
  kFailed,     ///< its last attempt ended without success; a later round may try again
  kLost,       ///< its last attempt left no end, and the scheduler no longer has it
  kNotQueued,  ///< it was never started, and is not queued
  kUnknown     ///< the scheduler does not answer
};
std::string_view task_state_name(TaskState state);

struct TaskStatus {
  std::string stage;
  int index = 0;
  TaskState state = TaskState::kUnknown;
  std::string frames, node, reason;
  int percent = 0;  ///< progress of a running task
  std::vector<schemas::FarmAttempt> attempts;
};

enum class JobState {
  kWaiting,
  kRunning,
  kUnknown,
  kStalled,
  kDone,
  kFailed,
  kCancelled,
  kStopped,
  kNotQueued  ///< written, but no task was ever queued or run
};
std::string_view job_state_name(JobState state);

struct JobStatus {
  schemas::FarmJobDocument job;
  JobState state = JobState::kUnknown;
  std::string reason;
  std::vector<TaskStatus> tasks;  ///< by stage, then index
  std::vector<std::pair<std::string, std::string>> excluded_nodes;
  int rounds = 0;
  std::int64_t frames = 0, frames_done = 0, frames_failed = 0;
  std::string missing_frames;         ///< of a job that is over
  std::string frames_below_coverage;  ///< the same; complete frames
  std::string frames_with_rot;        ///< the same; complete frames
  std::optional<double> seconds_left = {};
  double cpu_seconds = 0;
  std::int64_t light_field_frames_estimated = 0;

  /// Returns whether a task that frames depend on may still be queued or running.
  bool is_live() const;
  /// Returns whether a finished job still makes its movie and contact sheet.
  bool is_preview_running() const;
};

/// Returns a job's status from its records and, if it is not over, from the scheduler.
JobStatus job_status(const JobFolder& folder);

/// The scheduler's answers for job_status(), for tests and for engines that are queried elsewhere.
struct SchedulerAnswer {
  /// By Slurm's name of the task; none: the scheduler does not answer.
  std::optional<std::map<std::string, SlurmTask>> tasks;
  std::optional<bool> is_local_job_running;  ///< engine local; none: on another host
};
JobStatus job_status(const JobFolder& folder, const SchedulerAnswer& answer);

/// Return the status as plain text, as JSON, and as a self-contained HTML page.
std::string status_text(const JobStatus& status, bool all_tasks);
std::string status_json(const JobStatus& status);
std::string status_html(const JobStatus& status, const JobFolder& folder);

}  // namespace raystage::farm
