// SPDX-License-Identifier: Apache-2.0
// Verifies the frames of a job by their fingerprints (sequence_check.h) and decides what follows
// (rounds.h): the next round, or the end of the job and its preview. Cost: reading every file once.
#include "farm/verification.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <optional>
#include <set>

#include "base/atomic_file.h"
#include "base/error.h"
#include "base/resources.h"
#include "base/stopwatch.h"
#include "compose/derived_data.h"
#include "compose/frame_range.h"
#include "farm/attempts.h"
#include "farm/fingerprints.h"
#include "farm/rounds.h"
#include "farm/sequence_check.h"
#include "farm/slurm_scripts.h"
#include "farm/task_commands.h"

namespace raystage::farm {
namespace {

/// Returns the frames of tasks whose last attempt ended without success.
std::set<int> frames_of_failed_tasks(const VerificationRequest& request) {
  std::set<int> failed;
  for (const auto& [task, attempts] : read_attempts(request.folder)) {
    if (task.first != "render" || !attempts.back().end) continue;
    if (attempts.back().end->result == schemas::AttemptResult::kDone) continue;
    const auto chunk = static_cast<std::size_t>(task.second);
    if (chunk >= request.job.chunks.size()) continue;
    for (const int frame : compose::parse_frame_range(request.job.chunks[chunk].frames)) {
      failed.insert(frame);
    }
  }
  return failed;
}

std::vector<ExpectedFrame> expected_frames(const VerificationRequest& request) {
  const std::set<int> failed = frames_of_failed_tasks(request);
  if (request.job.distributed) {
    // A frame without a known fingerprint is incomplete: no file has an empty fingerprint.
    const std::map<int, std::string> known = read_fingerprints(request.folder.path());
    std::vector<ExpectedFrame> frames;
    for (const int frame : job_frames(request.job)) {
      const auto found = known.find(frame);
      const bool is_known = found != known.end();
      frames.push_back({frame, is_known ? found->second : "", is_known && !failed.contains(frame)});
    }
    return frames;
  }
  const compose::ShotPlan plan(request.shot, plan_options(request.job));
  const std::vector<int> numbers = job_frames(request.job);
  std::vector<ExpectedFrame> frames;
  for (const compose::PlannedFrame& frame :
       plan.plan(numbers, missing_frames_policy(request.job))) {
    frames.push_back({frame.frame, plan.fingerprint(frame, request.job.picture.chromaticities),
                      !failed.contains(frame.frame)});
  }
  return frames;
}

/// Returns the frames that must be replaced even if they are complete, and that no successful task
/// has replaced since.
std::set<int> frames_not_replaced(const VerificationRequest& request, int first_round) {
  std::optional<std::set<int>> named;
  for (const schemas::FarmRound& round : request.folder.rounds()) {
    if (round.round < first_round || round.round > request.round || round.frames.empty()) continue;
    const std::vector<int> frames = compose::parse_frame_range(round.frames);
    if (!named) named.emplace(frames.begin(), frames.end());
  }
  if (!named && request.job.existing != "overwrite") return {};
  const TaskAttempts attempts = read_attempts(request.folder);
  std::set<int> left;
  for (std::size_t i = 0; i < request.job.chunks.size(); ++i) {
    const auto found = attempts.find({"render", static_cast<int>(i)});
    const bool is_replaced =
        found != attempts.end() &&
        std::ranges::any_of(found->second, [&](const schemas::FarmAttempt& attempt) {
          const int since = named ? first_round : 1;
          return attempt.round >= since && attempt.end &&
                 attempt.end->result == schemas::AttemptResult::kDone;
        });
    if (is_replaced) continue;
    for (const int frame : compose::parse_frame_range(request.job.chunks[i].frames)) {
      if (!named || named->contains(frame)) left.insert(frame);
    }
  }
  return left;
}

/// Returns the faults of the nodes as text, each fault once.
std::string reasons_of(const std::vector<std::pair<std::string, std::string>>& excluded) {
  constexpr std::size_t kMaxReasons = 3;
  std::map<std::string, std::vector<std::string>> nodes_by_reason;
  for (const auto& [node, reason] : excluded) nodes_by_reason[reason].push_back(node);
  std::string text;
  std::size_t listed = 0;
  for (const auto& [reason, nodes] : nodes_by_reason) {
    if (++listed > kMaxReasons) break;
    text += fmt::format("{}{}: {}", text.empty() ? "" : "; ", fmt::join(nodes, ", "), reason);
  }
  return text;
}

/// Writes the script that queues the next round or the preview. The verification's batch script
/// runs it, because sbatch is not available in a container that wraps the tasks.
void write_follower(const VerificationRequest& request, const std::string& script) {
  if (request.job.engine != schemas::FarmJobDocument::Engine::kSlurm) return;
  write_file_atomically(
      request.folder.path() / fmt::format("after-verify-{}.sh", request.round),
      fmt::format("#!/bin/sh\n# Runs after round {}.\ncd \"$(dirname \"$0\")\" && sh {}\n",
                  request.round, script));
}

schemas::FarmAttempt::End conclude(const VerificationRequest& request,
                                   const std::vector<int>& not_whole, const std::stop_token& stop) {
  const auto excluded_nodes = request.folder.excluded_nodes();
  std::vector<std::string> excluded;
  for (const auto& [node, reason] : excluded_nodes) excluded.push_back(node);
  const TaskAttempts attempts = read_attempts(request.folder);
  int first_round = 1;
  for (const schemas::FarmRound& round : request.folder.rounds()) {
    if (round.fresh && round.round <= request.round) first_round = round.round;
  }
  std::set<int> all_missing = frames_not_replaced(request, first_round);
  const bool replaces = !all_missing.empty();
  all_missing.insert(not_whole.begin(), not_whole.end());
  const std::vector<int> missing(all_missing.begin(), all_missing.end());
  RoundDecision verdict =
      decide_next_round({request.job, attempts, missing, excluded, request.round, first_round});
  schemas::FarmAttempt::End end;
  end.result = missing.empty() ? schemas::AttemptResult::kDone : schemas::AttemptResult::kFailed;
  end.exit_code =
      static_cast<int>(missing.empty() ? ExitCode::kSuccess : ExitCode::kSomeFramesFailed);
  end.failed_frames = compose::format_frame_range(missing);
  if (!missing.empty()) {
    end.reason =
        fmt::format("{} frames are incomplete or outdated: {}", missing.size(), end.failed_frames);
  }
  if (verdict.next) {
    if (replaces) verdict.next->frames = compose::format_frame_range(missing);
    write_round(request.folder, request.job, *verdict.next);
    write_follower(request, fmt::format("round-{}.sh", verdict.next->round));
    return end;
  }
  if (missing.empty()) {
    const ShortFrames found =
        short_frames(compose::SequenceName(request.job.output), job_frames(request.job),
                     request.job.least_coverage, request.timeout_seconds, stop);
    if (stop.stop_requested()) {
      end.result = schemas::AttemptResult::kStopped;
      end.reason = "stopped by a signal";
      return end;
    }
    verdict.end.frames_below_coverage = compose::format_frame_range(found.below_coverage);
    verdict.end.frames_with_rot = compose::format_frame_range(found.with_rot);
  }
  if (verdict.no_node_left) verdict.end.reason += ". " + reasons_of(excluded_nodes);
  end_job(request.folder, request.job, verdict.end);
  if (verdict.end.state == schemas::FarmEnd::State::kDone && request.job.preview) {
    if (request.job.engine == schemas::FarmJobDocument::Engine::kSlurm) {
      // An excluded node may not see the frames.
      schemas::FarmRound round;
      round.round = request.round;
      round.exclude = excluded;
      write_file_atomically(request.folder.path() / "preview.sh",
                            preview_script(request.job, round));
    }
    write_follower(request, "preview.sh");
  }
  return end;
}

}  // namespace

void end_job(const JobFolder& folder, const schemas::FarmJobDocument& job, schemas::FarmEnd end) {
  // Written last, so that readers of the end can rely on the rest.
  const std::vector<std::filesystem::path> pinned(job.pinned.begin(), job.pinned.end());
  compose::unpin_derived_data(pinned, job.id);
  end.frames = static_cast<int>(job_frames(job).size());
  end.ended_utc = utc_now();
  folder.write_end(end);
}

std::vector<int> find_incomplete_frames(const VerificationRequest& request,
                                        const std::stop_token& stop) {
  SequenceCheckOptions options;
  options.deep = request.job.picture.deep;
  options.timeout_seconds = request.timeout_seconds;
  options.progress = request.progress;
  return missing_frames(compose::SequenceName(request.job.output), expected_frames(request),
                        options, stop);
}

schemas::FarmAttempt::End verify_job(const VerificationRequest& request,
                                     const std::stop_token& stop) {
  const Stopwatch watch;
  const double cpu_before = cpu_seconds();
  schemas::FarmAttempt::End end;
  try {
    const std::vector<int> missing = find_incomplete_frames(request, stop);
    if (stop.stop_requested()) {
      end.result = schemas::AttemptResult::kStopped;
      end.reason = "stopped by a signal";
    } else {
      end = conclude(request, missing, stop);
    }
  } catch (const Error& error) {
    // Another round cannot help: the shot's take was removed or changed.
    end.result = schemas::AttemptResult::kBadInput;
    end.exit_code = static_cast<int>(error.exit_code());
    end.reason = error.what();
    end_job(request.folder, request.job,
            {schemas::FarmEnd::State::kFailed,
             fmt::format("the frames cannot be verified: {}", error.what())});
  }
  end.wall_seconds = watch.seconds();
  end.cpu_seconds = cpu_seconds() - cpu_before;
  end.peak_memory_bytes = static_cast<double>(peak_memory());
  return end;
}

}  // namespace raystage::farm
