// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "schemas/farm_job_document.h"
#include "schemas/farm_records.h"

namespace raystage::schemas {
namespace {

using ::testing::HasSubstr;

FarmJobDocument full_job() {
  FarmJobDocument job;
  job.id = "s-1";
  job.engine = FarmJobDocument::Engine::kOpenJd;
  job.submitted_utc = 1'700'000'000 * kNanosecondsPerSecond;
  job.submitted_by = "anna";
  job.submitted_on = "ws1";
  job.program_version = "0.1.0";
  job.build = "0123456789abcdef";
  job.simd = "avx2";
  job.umask = 2;
  job.command_prefix = "apptainer exec x.sif";
  job.folder = "/out/s.farm/job-0001";
  job.shot = "/show/shot.json";
  job.shot_folder = "/show";
  job.output = "/out/s.####.exr";
  job.cache = "/cache";
  job.color_config = "/ocio";
  job.existing = "overwrite";
  job.missing = "hold";
  job.picture = {"push-pull", "nuke", true, true, true, true};
  int threads = 1;
  for (const FarmStage stage : kFarmStages) job.of(stage) = {threads++, 0.5, 20, {"--qos=x"}};
  job.attempts = 5;
  job.least_coverage = 0.9;
  job.rotten = "error";
  job.preview = false;
  job.max_array_size = 11;
  job.max_minutes = 90;
  job.seconds_per_frame = 0.125;
  job.frame_bytes = 1e6;
  job.instants = {{0, 7, "/take/depth/a/b.zst"}};
  job.chunks = {{"1-10", {0}}, {"11-20", {}}};
  job.inputs = {"/take/take.json"};
  job.pinned = {"/take/depth/a/b.zst"};
  job.paths = {{"/mnt/show", "/net/show"}, {"/out", "/net/out"}};
  return job;
}

TEST(FarmDocuments, AJobIsTheSameAfterReading) {
  const std::string text = format_farm_job(full_job());
  const FarmJobDocument back = parse_farm_job(text, "x");
  EXPECT_EQ(format_farm_job(back), text);
  EXPECT_EQ(back.of(FarmStage::kPreview).threads, 4);
  EXPECT_EQ(back.picture.layout, "nuke");
  EXPECT_EQ(back.chunks[0].instants, std::vector<int>{0});
  EXPECT_EQ(back.paths.at(1).to, "/net/out");
}

TEST(FarmDocuments, AJobThatContradictsItselfIsRefused) {
  FarmJobDocument job = full_job();
  job.chunks[1].instants = {1};
  EXPECT_THROW(parse_farm_job(format_farm_job(job), "x"), Error);
  job = full_job();
  job.chunks.clear();
  EXPECT_THROW(parse_farm_job(format_farm_job(job), "x"), Error);
  job = full_job();
  job.id = "a/b";
  EXPECT_THROW(parse_farm_job(format_farm_job(job), "x"), Error);
}

TEST(FarmDocuments, RecordsAreTheSameAfterReading) {
  FarmAttempt attempt;
  attempt.stage = "render";
  attempt.index = 3;
  attempt.attempt = 2;
  attempt.round = 1;
  attempt.node = "n1";
  attempt.process = 77;
  attempt.slurm_task = "12_3";
  attempt.restart = 1;
  attempt.build = "b";
  attempt.frames = "1-4";
  attempt.started_utc = 1'700'000'000 * kNanosecondsPerSecond;
  for (const AttemptResult result :
       {AttemptResult::kDone, AttemptResult::kFailed, AttemptResult::kBadInput,
        AttemptResult::kOutOfMemory, AttemptResult::kStopped, AttemptResult::kDeclined}) {
    attempt.end = FarmAttempt::End{result,
                                   1,
                                   "why",
                                   true,
                                   "2-3",
                                   1.5,
                                   2.5,
                                   3e8,
                                   1,
                                   2,
                                   RenderStageCosts{12, 2, 4.5, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 7e5},
                                   5};
    const std::string text = format_farm_attempt(attempt);
    EXPECT_EQ(format_farm_attempt(parse_farm_attempt(text, "x")), text);
    EXPECT_EQ(parse_farm_attempt(text, "x").end->result, result);
  }
  FarmRound round{2, {1}, {0, 3}, "1,12-14", 1.5, 2, {"n3"}, true, "ws1", "123", 9};
  EXPECT_EQ(format_farm_round(parse_farm_round(format_farm_round(round), "x")),
            format_farm_round(round));
  for (const FarmEnd::State state : {FarmEnd::State::kDone, FarmEnd::State::kFailed,
                                     FarmEnd::State::kCancelled, FarmEnd::State::kStopped}) {
    const std::string text = format_farm_end({state, "why", "1-2", "5", "7-9", 48, 17});
    EXPECT_EQ(format_farm_end(parse_farm_end(text, "x")), text);
    EXPECT_EQ(parse_farm_end(text, "x").state, state);
  }
}

TEST(FarmDocuments, ReasonsInOtherEncodingsDoNotHinderARecord) {
  FarmAttempt attempt;
  attempt.stage = "render";
  attempt.node = "n\351";
  attempt.end = FarmAttempt::End{};
  attempt.end->reason = "caf\351";
  EXPECT_EQ(parse_farm_attempt(format_farm_attempt(attempt), "x").end->reason, "caf\xEF\xBF\xBD");
  EXPECT_NO_THROW(format_farm_end({FarmEnd::State::kFailed, "caf\351", "", "", "", 1, 0}));
}

TEST(FarmDocuments, StagesHaveNames) {
  for (const FarmStage stage : kFarmStages) {
    EXPECT_EQ(parse_farm_stage(farm_stage_name(stage)), stage);
  }
  try {
    parse_farm_stage("rendr");
    FAIL();
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("prepare, render, verify or preview"));
  }
}

}  // namespace
}  // namespace raystage::schemas
