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

/// What follows a verification.
struct RoundDecision {
  std::optional<FarmRound> next;  ///< none: the job is over
  FarmEnd end = {};               ///< where it is
  bool no_node_left = false;      ///< why it is: no node is worth trying
};

/// What is known when a round is over.
struct RoundOutcome {
  const FarmJobDocument& job;
  const TaskAttempts& attempts;
  std::span<const int> missing_frames;  ///< sorted
  std::vector<std::string> excluded;    ///< nodes
  int round = 1;
  int first_round = 1;  ///< attempts of earlier rounds do not count
};

/// A frame that is missing brings its chunk into the next round, unless its task has failed
/// `attempts` times, fails by its inputs, or ran out of memory again with 1.5 times the memory. A
/// task that did not end by itself (its node died, it was declined) is tried further. Tasks that
/// ran out of memory, or were stopped, bring 1.5 times the memory, or twice the time, to their
/// round. Where every node that was tried is at fault, or more than three and a quarter of them
/// are, it is not the nodes: the job fails.
RoundDecision decide_next_round(const RoundOutcome& state);

/// Whether a chunk need not wait for an instant any longer: it was prepared, or its preparation
/// failed twice, and the chunk derives it itself.
bool needs_no_preparation(const std::vector<FarmAttempt>& attempts);

/// The chunks that hold any of the frames, sorted.
std::vector<int> chunks_with_frames(const FarmJobDocument& job, std::span<const int> frames);

/// All frames of the job, sorted.
std::vector<int> job_frames(const FarmJobDocument& job);

}  // namespace raystage::farm
