// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/time.h"

namespace raystage::schemas {

/// The result of one attempt at a task.
enum class AttemptResult {
  kDone,         ///< all requested output exists
  kFailed,       ///< may succeed on another node or later
  kBadInput,     ///< fails again with the same inputs
  kOutOfMemory,  ///< may succeed with more memory
  kStopped,      ///< ended by a signal: time limit, preemption, cancellation
  kDeclined      ///< the job excludes this node or this build
};
/// Returns the name used in documents, e.g. "out_of_memory".
std::string_view attempt_result_name(AttemptResult result);

/// The costs of the rendering stages of an attempt, in seconds and bytes per frame, from its log.
/// Several frames are rendered concurrently, and writing overlaps the other stages.
struct RenderStageCosts {
  int frames = 0, frames_in_flight = 1;  ///< frames rendered; frames rendered concurrently
  double seconds = 0;                    ///< wall-clock seconds of all frames
  double light_fields_s = 0;             ///< including decoding and depth estimation
  double geometry_s = 0, merge_s = 0, encode_s = 0, write_s = 0;
  double decode_s = 0;  ///< CPU seconds
  double read_bytes = 0;
};

/// Schema "raystage/farm_attempt/1": one attempt at a task.
struct FarmAttempt {
  struct End {
    AttemptResult result = AttemptResult::kFailed;
    int exit_code = 1;               ///< of the command; 128 + n if signal n ended it
    std::string reason = {};         ///< text for the user; empty if kDone
    bool node_fault = false;         ///< the node caused the failure, not the task
    std::string failed_frames = {};  ///< a frame range; empty: none or unknown
    double wall_seconds = 0, cpu_seconds = 0;
    double peak_memory_bytes = 0;
    /// Numbers of light field frames whose depths were estimated, or loaded from disk.
    int light_field_frames_estimated = 0, light_field_frames_loaded = 0;
    std::optional<RenderStageCosts> rendering = {};  ///< present if a frame was rendered
    std::optional<Nanoseconds> ended_utc = {};
  };
  std::string stage;  ///< name of a FarmStage, or "measure"
  int index = 0;
  int attempt = 1;
  int round = 0;
  std::string node;
  std::int64_t process = 0;
  std::string slurm_task = {};  ///< "123_4"; empty: not started by Slurm
  int restart = 0;              ///< number of earlier requeues by Slurm
  std::string build = {}, frames = {};
  Nanoseconds started_utc = 0;  ///< by the node's clock
  std::optional<End> end = {};  ///< nullopt: it is running, or ended without a record
};
FarmAttempt parse_farm_attempt(std::string_view text, std::string_view name);
std::string format_farm_attempt(const FarmAttempt& attempt);

/// Schema "raystage/farm_round/1": tasks that are queued together.
struct FarmRound {
  int round = 1;
  std::vector<int> prepare = {}, render = {};  ///< indices of tasks
  /// Range of the frames that are rendered again, complete or not; empty: the incomplete frames.
  std::string frames = {};
  double memory_factor = 1, time_factor = 1;  ///< factors on the job's settings
  std::vector<std::string> exclude = {};      ///< names of excluded nodes
  bool fresh = false;  ///< a user started it: attempts of earlier rounds do not count
  /// For engine "local": the process that runs the round.
  std::string host = {}, process_start = {};
  std::int64_t process = 0;
};
FarmRound parse_farm_round(std::string_view text, std::string_view name);
std::string format_farm_round(const FarmRound& round);

/// Schema "raystage/farm_end/1": the job has ended; no more tasks are queued.
struct FarmEnd {
  enum class State { kDone, kFailed, kCancelled, kStopped };
  State state = State::kDone;
  std::string reason = {}, missing_frames = {};
  std::string frames_below_coverage = {};  ///< complete, but below FarmJobDocument::least_coverage
  std::string frames_with_rot = {};        ///< complete, but cameras with rotten frames are absent
  int frames = 0;
  Nanoseconds ended_utc = 0;
};
std::string_view farm_end_state_name(FarmEnd::State state);
FarmEnd parse_farm_end(std::string_view text, std::string_view name);
std::string format_farm_end(const FarmEnd& end);

}  // namespace raystage::schemas
