// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/time.h"

namespace raystage {

/// How an attempt at a task ended.
enum class AttemptResult {
  kDone,         ///< everything that was asked for exists
  kFailed,       ///< may succeed on another node or later
  kBadInput,     ///< fails again with the same inputs
  kOutOfMemory,  ///< may succeed with more memory
  kStopped,      ///< by a signal: time limit, preemption, cancellation
  kDeclined      ///< the job does not use this node or this build
};
/// As the documents write it, e.g. "out_of_memory".
std::string_view attempt_result_name(AttemptResult result);

/// What the stages of rendering took in one attempt: seconds and bytes a frame, as its log says.
/// Several frames are under way at once, and writing goes on next to the other stages.
struct RenderStageCosts {
  int frames = 0, frames_in_flight = 1;  ///< that were rendered; under way at once
  double seconds = 0;                    ///< wall-clock of all frames
  double light_fields_s = 0;             ///< decoding and solving included
  double geometry_s = 0, merge_s = 0, encode_s = 0, write_s = 0;
  double decode_s = 0;  ///< of processors
  double read_bytes = 0;
};

/// schema "raystage/farm_attempt/1": one attempt at a task.
struct FarmAttempt {
  struct End {
    AttemptResult result = AttemptResult::kFailed;
    int exit_code = 1;               ///< of the command; 128 + n where signal n ended it
    std::string reason = {};         ///< for people; empty where it is done
    bool node_fault = false;         ///< the node is at fault, not the task
    std::string failed_frames = {};  ///< a frame range; empty: none, or unknown
    double wall_seconds = 0, cpu_seconds = 0;
    double peak_memory_bytes = 0;
    int light_field_frames_estimated = 0,
        light_field_frames_loaded = 0;               ///< light field frames, by their depths
    std::optional<RenderStageCosts> rendering = {};  ///< where a frame was rendered
    std::optional<Nanoseconds> ended_utc = {};
  };
  std::string stage;  ///< of FarmStage, or "measure"
  int index = 0;
  int attempt = 1;
  int round = 0;
  std::string node;
  std::int64_t process = 0;
  std::string slurm_task = {};  ///< "123_4"; empty: Slurm did not start it
  int restart = 0;              ///< how often Slurm had requeued it before
  std::string build = {}, frames = {};
  Nanoseconds started_utc = 0;  ///< by the node's clock
  std::optional<End> end = {};  ///< none: it runs, or ended without leaving a record
};
FarmAttempt parse_farm_attempt(std::string_view text, std::string_view name);
std::string format_farm_attempt(const FarmAttempt& attempt);

/// schema "raystage/farm_round/1": tasks that are queued together.
struct FarmRound {
  int round = 1;
  std::vector<int> prepare = {}, render = {};  ///< indices of tasks
  /// A frame range: these frames of the chunks are rendered anew, whole or not. Empty: those that
  /// are not whole.
  std::string frames = {};
  double memory_factor = 1, time_factor = 1;  ///< of what the job says
  std::vector<std::string> exclude = {};      ///< nodes
  bool fresh = false;  ///< a person started it: attempts of earlier rounds no longer count
  /// Of engine local: the process that runs the round.
  std::string host = {}, process_start = {};
  std::int64_t process = 0;
};
FarmRound parse_farm_round(std::string_view text, std::string_view name);
std::string format_farm_round(const FarmRound& round);

/// schema "raystage/farm_end/1": nothing more is queued.
struct FarmEnd {
  enum class State { kDone, kFailed, kCancelled, kStopped };
  State state = State::kDone;
  std::string reason = {}, missing_frames = {};
  int frames = 0;
  Nanoseconds ended_utc = 0;
};
std::string_view farm_end_state_name(FarmEnd::State state);
FarmEnd parse_farm_end(std::string_view text, std::string_view name);
std::string format_farm_end(const FarmEnd& end);

}  // namespace raystage
