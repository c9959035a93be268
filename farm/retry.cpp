// SPDX-License-Identifier: Apache-2.0
#include "farm/retry.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <iterator>
#include <set>
#include <system_error>

#include "base/atomic_file.h"
#include "base/error.h"
#include "compose/derived_data.h"
#include "compose/frame_range.h"
#include "farm/rounds.h"
#include "farm/slurm_queue.h"
#include "farm/slurm_scripts.h"
#include "farm/status.h"
#include "farm/task.h"
#include "farm/verification.h"

namespace raystage::farm {
namespace {

namespace fs = std::filesystem;

std::vector<int> frames_in_chunks(const schemas::FarmJobDocument& job,
                                  const std::vector<int>& chunks) {
  std::set<int> frames;
  for (const int chunk : chunks) {
    for (const int frame : compose::parse_frame_range(job.chunks[chunk].frames))
      frames.insert(frame);
  }
  return {frames.begin(), frames.end()};
}

void check_not_live(const JobFolder& folder) {
  const JobStatus status = job_status(folder);
  if (!status.is_live()) return;
  throw Error::bad_input("the job is not over: it is " + std::string(job_state_name(status.state)),
                         folder.path().string(), "Wait for it, or cancel it first");
}

/// Rejects two live jobs of one output: each would find the fingerprints of the other wrong.
void check_no_other(const JobFolder& folder) {
  const std::string output = folder.local_job().output;
  const auto newest = find_live_job(output);
  const auto before = find_live_job(output, folder.path());
  for (const auto& other : {newest, before}) {
    if (!other || other->path().filename() == folder.path().filename()) continue;
    throw Error::bad_input("another job of this output is not over", other->path().string(),
                           "Wait for it, or cancel it first");
  }
}

/// Returns the instants of these chunks whose derived data is not stored.
std::vector<int> missing_instants(const schemas::FarmJobDocument& job,
                                  const std::vector<int>& chunks) {
  std::set<int> missing;
  for (const int chunk : chunks) {
    for (const int i : job.chunks[chunk].instants) {
      if (!file_exists(job.instants[i].file)) missing.insert(i);
    }
  }
  return {missing.begin(), missing.end()};
}

}  // namespace

void queue_round(const JobFolder& folder, const schemas::FarmRound& round) {
  const bool waits = round.round == 1 && file_exists(folder.after_file());
  try {
    run_queue_script(folder, waits ? "start.sh" : fmt::format("round-{}.sh", round.round));
  } catch (const Error& error) {
    const schemas::FarmJobDocument job = folder.local_job();
    try {
      cancel_slurm_job(job);  // the tasks that Slurm accepted
    } catch (const Error&) {  // report the first error only
    }
    end_job(folder, job,
            {schemas::FarmEnd::State::kFailed, error.what(),
             compose::format_frame_range(frames_in_chunks(job, round.render))});
    throw;
  }
}

schemas::FarmRound write_retry_round(const JobFolder& folder,
                                     const std::optional<std::vector<int>>& frames,
                                     const std::stop_token& stop) {
  check_not_live(folder);
  check_no_other(folder);
  const MappedJob here = read_local_job(folder);
  const schemas::FarmJobDocument& job = here.job;
  schemas::FarmRound round;
  round.round = static_cast<int>(folder.rounds().size()) + 1;
  round.fresh = true;
  std::vector<int> wanted;
  if (frames) {
    std::ranges::set_intersection(*frames, job_frames(job), std::back_inserter(wanted));
    round.frames = compose::format_frame_range(wanted);
  } else {
    wanted = find_incomplete_frames({folder, job, here.shot, round.round, 0, [](double) {}}, stop);
  }
  round.render = chunks_with_frames(job, wanted);
  if (round.render.empty()) {
    throw frames
        ? Error::bad_input("the job has none of these frames; its frames are " +
                               compose::format_frame_range(job_frames(job)),
                           folder.path().string(), "Name frames of the job")
        : Error::bad_input("nothing to retry: every frame is complete", folder.path().string(),
                           "Name the frames to render again. To make only the movie, run "
                           "`raystage preview`");
  }
  round.prepare = missing_instants(job, round.render);
  compose::pin_derived_data(std::vector<fs::path>(job.pinned.begin(), job.pinned.end()), job.id);
  // Faulty nodes may have been repaired since.
  std::error_code ignored;
  for (const auto& [node, reason] : folder.excluded_nodes()) {
    fs::remove(folder.excluded() / node, ignored);
  }
  folder.reopen();
  write_round(folder, folder.job(), round);
  return round;
}

}  // namespace raystage::farm
