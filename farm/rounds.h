// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "farm/attempts.h"
#include "schemas/farm_job_document.h"
#include "schemas/farm_records.h"

namespace raystage::farm {

/// The decision after a verification.
struct RoundDecision {
  std::optional<schemas::FarmRound> next;  ///< none: the job is over
  schemas::FarmEnd end = {};               ///< valid if the job is over
  bool no_node_left = false;               ///< the job is over because no usable node is left
};

/// The state of the job at the end of a round.
struct RoundOutcome {
  const schemas::FarmJobDocument& job;
  const TaskAttempts& attempts;
  std::span<const int> missing_frames;  ///< sorted
  std::vector<std::string> excluded;    ///< nodes
  int round = 1;
  int first_round = 1;  ///< attempts of earlier rounds do not count
};

/// Decides which chunks run again. The chunk of a missing frame is in the next round. Exceptions:
/// its task failed `attempts` times, failed because of its inputs, or ran out of memory even with
/// 1.5 times the memory. A task that did not end by itself (its node died, or it was declined) runs
/// again. The next round has 1.5 times the memory if a task ran out of memory, and twice the time
/// if one was stopped. The job fails if all tried nodes have faults, or more than three and also
/// more than a quarter of them. The cause is then probably not the nodes.
RoundDecision decide_next_round(const RoundOutcome& state);

/// Returns whether chunks no longer wait for an instant: it was prepared, or its preparation failed
/// twice and each chunk derives the data itself.
bool needs_no_preparation(const std::vector<schemas::FarmAttempt>& attempts);

/// Returns the indices of the chunks that contain any of the frames, sorted.
std::vector<int> chunks_with_frames(const schemas::FarmJobDocument& job,
                                    std::span<const int> frames);

/// Returns all frames of the job, sorted.
std::vector<int> job_frames(const schemas::FarmJobDocument& job);

}  // namespace raystage::farm
