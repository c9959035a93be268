// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "base/atomic_file.h"
#include "farm/job_folder.h"
#include "schemas/farm_job_document.h"

namespace raystage::testing {

/// Returns twelve frames in four chunks; two depend on one prepare task, the third on another.
inline schemas::FarmJobDocument make_small_job(const std::filesystem::path& folder = "/job") {
  schemas::FarmJobDocument job;
  job.id = "shot-00000001";
  job.submitted_utc = 1'700'000'000 * kNanosecondsPerSecond;
  job.program_version = "0.1.0";
  job.program = "/opt/raystage/bin/raystage";
  job.folder = folder.string();
  job.shot = "/show/shot.json";
  job.shot_folder = "/show";
  job.output = (folder / "f.####.exr").string();
  job.instants = {{0, 3, "/take/depth/a/b.zst"}, {0, 4, "/take/depth/a/c.zst"}};
  job.chunks = {{"1-3", {0}}, {"4-6", {0}}, {"7-9", {1}}, {"10-12", {}}};
  job.max_array_size = 1000;
  for (const schemas::FarmStage stage : schemas::kFarmStages) job.of(stage) = {2, 0.5, 20, {}};
  return job;
}

inline schemas::FarmRound first_round() {
  schemas::FarmRound round;
  round.prepare = {0, 1};
  round.render = {0, 1, 2, 3};
  return round;
}

/// Creates the job folder of make_small_job() in `parent`, as after a submission.
inline farm::JobFolder write_small_job(
    const std::filesystem::path& parent,
    schemas::FarmJobDocument::Engine engine = schemas::FarmJobDocument::Engine::kSlurm) {
  const farm::JobFolder folder = farm::create_job_folder((parent / "f.####.exr").string());
  schemas::FarmJobDocument job = make_small_job(parent);
  job.folder = folder.path().string();
  job.engine = engine;
  write_file_atomically(folder.round_file(1), schemas::format_farm_round(first_round()));
  write_file_atomically(folder.job_file(), schemas::format_farm_job(job));
  return folder;
}

inline schemas::FarmAttempt make_attempt(int chunk, schemas::AttemptResult result,
                                         const std::string& node = "n1", int round = 1) {
  schemas::FarmAttempt attempt;
  attempt.stage = "render";
  attempt.index = chunk;
  attempt.round = round;
  attempt.node = node;
  attempt.end = schemas::FarmAttempt::End{};
  attempt.end->result = result;
  attempt.end->exit_code = result == schemas::AttemptResult::kDone ? 0 : 1;
  attempt.end->wall_seconds = 6;
  if (result != schemas::AttemptResult::kDone) attempt.end->reason = "it broke";
  return attempt;
}

}  // namespace raystage::testing
