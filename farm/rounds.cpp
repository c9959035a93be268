// SPDX-License-Identifier: Apache-2.0
// Decides the next round of a job after a verification, from the attempts of its tasks. Inputs: the
// job, the attempts by task, the missing frames and the excluded nodes. Output: a round with the
// chunks to run again and the factors of memory and time, or the end of the job. See
// decide_next_round() for the rules. Cost: linear in attempts and frames of the job.
#include "farm/rounds.h"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>
#include <map>
#include <set>

#include "compose/frame_range.h"

namespace raystage::farm {
namespace {

constexpr double kMoreMemory = 1.5, kMoreTime = 2;
/// Limit of attempts that failed without the task's fault; beyond it the task is given up.
constexpr int kMaxLostAttempts = 10;
/// With more faulty nodes than this number, and than this share of those tried, the job fails.
constexpr std::size_t kMaxExcluded = 3, kMaxExcludedPart = 4;
constexpr std::size_t kLongestReason = 3000;

struct TaskHistory {
  int failed = 0;         ///< ended by itself, without success
  int without_blame = 0;  ///< lost with a node, declined by one, or the node's fault
  int out_of_memory = 0;
  bool stopped = false;    ///< a signal ended the last attempt
  bool bad_input = false;  ///< the last attempt failed because of its inputs
  std::string reason;      ///< of the last failure
};

TaskHistory history_of(const std::vector<schemas::FarmAttempt>& attempts, int first_round) {
  TaskHistory history;
  for (const schemas::FarmAttempt& attempt : attempts) {
    if (attempt.round < first_round) continue;
    if (!attempt.end) {
      ++history.without_blame;
      continue;
    }
    const schemas::FarmAttempt::End& end = *attempt.end;
    history.bad_input = end.result == schemas::AttemptResult::kBadInput;
    history.stopped = end.result == schemas::AttemptResult::kStopped;
    if (end.result == schemas::AttemptResult::kOutOfMemory) ++history.out_of_memory;
    if (end.result == schemas::AttemptResult::kDeclined || end.node_fault) {
      ++history.without_blame;
    } else {
      ++history.failed;  // also a successful attempt, because its frames are missing
    }
    if (!end.reason.empty()) history.reason = end.reason;
  }
  return history;
}

bool may_try_again(const schemas::FarmJobDocument& job, const TaskHistory& history) {
  return !history.bad_input && history.out_of_memory < 2 && history.failed < job.attempts &&
         history.without_blame < kMaxLostAttempts;
}

/// Adds the instants of a chunk that must be prepared again to the next round.
void add_instants(const RoundOutcome& state, int chunk, schemas::FarmRound& next) {
  for (const int instant : state.job.chunks[chunk].instants) {
    const auto found = state.attempts.find({"prepare", instant});
    if (found == state.attempts.end() || needs_no_preparation(found->second)) continue;
    if (std::ranges::find(next.prepare, instant) != next.prepare.end()) continue;
    next.prepare.push_back(instant);
    if (history_of(found->second, state.first_round).out_of_memory > 0) {
      next.memory_factor = kMoreMemory;
    }
  }
  std::ranges::sort(next.prepare);
}

/// Returns whether no usable node is left.
bool is_every_node_at_fault(const RoundOutcome& state) {
  std::set<std::string> tried;
  for (const auto& [task, attempts] : state.attempts) {
    if (task.first != "prepare" && task.first != "render") continue;
    for (const schemas::FarmAttempt& attempt : attempts) tried.insert(attempt.node);
  }
  if (state.excluded.size() > std::max(kMaxExcluded, tried.size() / kMaxExcludedPart)) return true;
  return tried.size() > 1 && std::ranges::all_of(tried, [&](const std::string& node) {
           return std::ranges::find(state.excluded, node) != state.excluded.end();
         });
}

}  // namespace

bool needs_no_preparation(const std::vector<schemas::FarmAttempt>& attempts) {
  int failed = 0;
  for (const schemas::FarmAttempt& attempt : attempts) {
    if (!attempt.end || attempt.end->node_fault) continue;
    if (attempt.end->result == schemas::AttemptResult::kDone) return true;
    if (attempt.end->result == schemas::AttemptResult::kDeclined) continue;
    ++failed;
  }
  return failed >= 2;
}

std::vector<int> chunks_with_frames(const schemas::FarmJobDocument& job,
                                    std::span<const int> frames) {
  std::vector<int> chunks;
  for (std::size_t i = 0; i < job.chunks.size(); ++i) {
    const std::vector<int> own = compose::parse_frame_range(job.chunks[i].frames);
    if (std::ranges::any_of(own, [&](int f) { return std::ranges::binary_search(frames, f); })) {
      chunks.push_back(static_cast<int>(i));
    }
  }
  return chunks;
}

std::vector<int> job_frames(const schemas::FarmJobDocument& job) {
  std::vector<int> frames;
  for (const schemas::FarmJobDocument::Chunk& chunk : job.chunks) {
    const std::vector<int> own = compose::parse_frame_range(chunk.frames);
    frames.insert(frames.end(), own.begin(), own.end());
  }
  std::ranges::sort(frames);
  frames.erase(std::unique(frames.begin(), frames.end()), frames.end());
  return frames;
}

RoundDecision decide_next_round(const RoundOutcome& state) {
  RoundDecision verdict;
  verdict.end.frames = static_cast<int>(job_frames(state.job).size());
  if (state.missing_frames.empty()) return verdict;
  schemas::FarmRound next;
  next.round = state.round + 1;
  next.exclude = state.excluded;
  std::map<std::string, std::vector<int>> given_up;  // by reason
  for (const int chunk : chunks_with_frames(state.job, state.missing_frames)) {
    const auto found = state.attempts.find({"render", chunk});
    const TaskHistory history = found == state.attempts.end()
                                    ? TaskHistory{}
                                    : history_of(found->second, state.first_round);
    if (!may_try_again(state.job, history)) {
      const std::vector<int> own = compose::parse_frame_range(state.job.chunks[chunk].frames);
      std::ranges::copy_if(own, std::back_inserter(given_up[history.reason]), [&](int f) {
        return std::ranges::binary_search(state.missing_frames, f);
      });
      continue;
    }
    next.render.push_back(chunk);
    add_instants(state, chunk, next);
    if (history.out_of_memory > 0) next.memory_factor = kMoreMemory;
    if (history.stopped) next.time_factor = kMoreTime;
  }
  verdict.no_node_left = is_every_node_at_fault(state);
  if (!next.render.empty() && !verdict.no_node_left &&
      state.round - state.first_round < state.job.attempts + kMaxLostAttempts) {
    verdict.next = next;
    return verdict;
  }
  verdict.end.state = schemas::FarmEnd::State::kFailed;
  verdict.end.missing_frames =
      compose::format_frame_range({state.missing_frames.begin(), state.missing_frames.end()});
  for (auto& [reason, frames] : given_up) {
    std::ranges::sort(frames);
    verdict.end.reason += fmt::format("{}frames {}: {}", verdict.end.reason.empty() ? "" : "; ",
                                      compose::format_frame_range(frames),
                                      reason.empty() ? "no attempt recorded a reason" : reason);
    if (verdict.end.reason.size() > kLongestReason) break;
  }
  if (verdict.no_node_left) {
    verdict.end.reason +=
        fmt::format("{}{} nodes failed; the cause is probably not the nodes",
                    verdict.end.reason.empty() ? "" : "; ", state.excluded.size());
  }
  return verdict;
}

}  // namespace raystage::farm
