// SPDX-License-Identifier: Apache-2.0
#include "farm/status.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <nlohmann/json.hpp>

#include "testing/farm/test_job.h"
#include "testing/test_folder.h"

namespace raystage::farm {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

class Status : public ::testing::Test {
 protected:
  void happened(schemas::FarmAttempt attempt) {
    const auto end = attempt.end;
    attempt.end.reset();
    record_attempt_start(folder_, attempt);
    if (end) {
      attempt.end = end;
      record_attempt_end(folder_, attempt);
    }
  }
  void started(int chunk, const std::string& node) {
    schemas::FarmAttempt attempt =
        testing::make_attempt(chunk, schemas::AttemptResult::kDone, node);
    attempt.end.reset();
    happened(attempt);
  }
  static SlurmTask slurm(const std::string& stage, const std::string& task,
                         const std::string& state, const std::string& node = "") {
    return {stage, task, state, "", node, 0};
  }
  static const TaskStatus& render(const JobStatus& status, int chunk) {
    return *std::ranges::find_if(status.tasks, [&](const TaskStatus& task) {
      return task.stage == "render" && task.index == chunk;
    });
  }

  testing::TestFolder parent_;
  const JobFolder folder_ = testing::write_small_job(parent_.path());
};

TEST_F(Status, IsKnownFromRecordsWhileTheControllerIsDown) {
  happened(testing::make_attempt(0, schemas::AttemptResult::kDone));
  started(1, "n2");
  const JobStatus status = job_status(folder_, SchedulerAnswer{});
  EXPECT_EQ(status.state, JobState::kUnknown);
  EXPECT_EQ(status.frames_done, 3);
  EXPECT_EQ(render(status, 0).state, TaskState::kDone);
  EXPECT_EQ(render(status, 1).state, TaskState::kUnknown) << "it may have died with its node";
  EXPECT_EQ(render(status, 2).state, TaskState::kUnknown);
  EXPECT_THAT(status_text(status, false),
              HasSubstr("unknown (the Slurm controller does not answer"));
}

TEST_F(Status, AsksSlurmForWhatIsNotOver) {
  happened(testing::make_attempt(0, schemas::AttemptResult::kDone));
  started(1, "n2");
  started(2, "n3");
  std::ofstream(folder_.progress() / "render.0001") << "40\n";
  SchedulerAnswer answer;
  answer.tasks.emplace();
  for (const SlurmTask& task :
       {slurm("render", "7_1", "RUNNING", "n2"), slurm("render", "7_2", "PENDING"),
        slurm("render", "7_3", "PENDING"), slurm("verify", "8", "PENDING")}) {
    (*answer.tasks)[task.task] = task;
  }
  const JobStatus status = job_status(folder_, answer);
  EXPECT_EQ(status.state, JobState::kRunning);
  EXPECT_EQ(render(status, 1).state, TaskState::kRunning);
  EXPECT_EQ(render(status, 1).percent, 40);
  EXPECT_EQ(render(status, 2).state, TaskState::kWaiting) << "its node died; it is queued again";
  EXPECT_EQ(render(status, 3).state, TaskState::kWaiting);
  ASSERT_TRUE(status.seconds_left);
  EXPECT_NEAR(*status.seconds_left, (1.8 + 3 + 3) * 2.0, 1e-9);  // 2 s a frame, one task at a time
}

TEST_F(Status, AddsUpNumbersOfAnySize) {
  schemas::FarmAttempt attempt = testing::make_attempt(0, schemas::AttemptResult::kDone);
  attempt.end->light_field_frames_estimated = 1'000'000'000;  // the largest that a record may have
  for (attempt.index = 0; attempt.index < 3; ++attempt.index) happened(attempt);
  EXPECT_EQ(job_status(folder_, SchedulerAnswer{}).light_field_frames_estimated, 3'000'000'000);
}

TEST_F(Status, ATaskThatNobodyHasIsLost) {
  started(1, "n2");
  SchedulerAnswer answer;
  answer.tasks.emplace();
  const JobStatus status = job_status(folder_, answer);
  EXPECT_EQ(render(status, 1).state, TaskState::kLost);
  EXPECT_EQ(status.state, JobState::kStalled);
  EXPECT_FALSE(status.is_live());
}

TEST_F(Status, ATaskThatSlurmCouldNotStartHasFailedWithoutARecord) {
  SchedulerAnswer answer;
  answer.tasks.emplace();
  (*answer.tasks)["7_1"] = slurm("render", "7_1", "FAILED", "n1");
  const JobStatus status = job_status(folder_, answer);
  EXPECT_EQ(render(status, 1).state, TaskState::kFailed);
  EXPECT_EQ(status.frames_failed, 3);
  EXPECT_THAT(status_text(status, true), HasSubstr("Slurm: FAILED"));
}

TEST_F(Status, AFrameThatIsMissingIsNotDoneWhateverItsTaskSaid) {
  for (int i = 0; i < 4; ++i) happened(testing::make_attempt(i, schemas::AttemptResult::kDone));
  schemas::FarmEnd end;
  end.state = schemas::FarmEnd::State::kFailed;
  end.missing_frames = "3";
  end.ended_utc = utc_now();
  folder_.write_end(end);
  EXPECT_EQ(job_status(folder_).frames_done, 11);
}

TEST_F(Status, ArraysThatWereSplitKeepTheirTasks) {
  std::ofstream(folder_.slurm_ids() / "offset.9") << "2\n";
  SchedulerAnswer answer;
  answer.tasks.emplace();
  (*answer.tasks)["9_1"] = slurm("render", "9_1", "RUNNING", "n1");
  EXPECT_EQ(render(job_status(folder_, answer), 3).state, TaskState::kRunning);
}

TEST_F(Status, AJobThatWasOnlyWrittenIsNotQueued) {
  SchedulerAnswer answer;
  answer.tasks.emplace();
  EXPECT_EQ(job_status(folder_, answer).state, JobState::kNotQueued);
  std::ofstream(folder_.slurm_ids() / "verify.1") << "7\n";
  EXPECT_EQ(job_status(folder_, answer).state, JobState::kStalled) << "it was, and Slurm forgot it";
}

TEST_F(Status, WhatSlurmNeverStartsIsStalled) {
  SchedulerAnswer answer;
  answer.tasks.emplace();
  (*answer.tasks)["7_1"] = slurm("render", "7_1", "PENDING");
  (*answer.tasks)["7_1"].reason = "ReqNodeNotAvail, UnavailableNodes:n1";
  JobStatus status = job_status(folder_, answer);
  EXPECT_EQ(status.state, JobState::kWaiting);
  EXPECT_THAT(status.reason, HasSubstr("ReqNodeNotAvail"));
  (*answer.tasks)["7_1"].reason = "BadConstraints";
  status = job_status(folder_, answer);
  EXPECT_EQ(status.state, JobState::kStalled);
  EXPECT_THAT(status.reason, HasSubstr("BadConstraints"));
}

TEST_F(Status, ADoneJobGoesOnWithItsPreviewAndMissesFramesThatWereRemoved) {
  for (int i = 0; i < 4; ++i) happened(testing::make_attempt(i, schemas::AttemptResult::kDone));
  schemas::FarmEnd end;
  end.ended_utc = utc_now();
  folder_.write_end(end);
  const compose::SequenceName name(folder_.job().output);
  for (int frame = 1; frame <= 12; ++frame) std::ofstream(name.path(frame)) << "x";
  SchedulerAnswer answer;
  answer.tasks.emplace();
  (*answer.tasks)["9"] = slurm("preview", "9", "RUNNING", "n1");
  JobStatus status = job_status(folder_, answer);
  EXPECT_EQ(status.state, JobState::kDone);
  EXPECT_TRUE(status.is_preview_running());
  EXPECT_EQ(status.tasks.back().state, TaskState::kRunning);
  EXPECT_EQ(status.missing_frames, "");
  std::filesystem::remove(name.path(5));
  answer.tasks->clear();
  status = job_status(folder_, answer);
  EXPECT_EQ(status.missing_frames, "5");
  EXPECT_EQ(status.frames_done, 11);
  EXPECT_FALSE(status.is_preview_running());
}

// Whoever may write into the job folder chooses these names and texts.
TEST_F(Status, NamesAndReasonsCannotForgeLinesOrBreakJson) {
  folder_.exclude("n\xFF\nnode good is excluded: no", "bad \x1b[31m\xFF\nframes 1-99 done");
  const JobStatus status = job_status(folder_, SchedulerAnswer{});
  const std::string text = status_text(status, true);
  EXPECT_THAT(text, HasSubstr("is excluded: bad \\u001b[31m"));
  EXPECT_THAT(text, Not(HasSubstr("\nnode good")));
  EXPECT_THAT(text, Not(HasSubstr("\nframes 1-99")));
  schemas::FarmEnd end;
  end.state = schemas::FarmEnd::State::kFailed;
  end.reason = "line\nframes 1-3 done";
  folder_.write_end(end);
  EXPECT_THAT(status_text(job_status(folder_), true), Not(HasSubstr("\nframes 1-3")));
  const auto document = nlohmann::json::parse(status_json(status));
  ASSERT_EQ(document["excluded_nodes"].size(), 1U);
  EXPECT_THAT(document["excluded_nodes"].begin().key(), HasSubstr("\xEF\xBF\xBD"));
}

TEST_F(Status, TheEndIsTheRecordsWhateverSlurmSays) {
  for (int i = 0; i < 4; ++i) {
    happened(testing::make_attempt(
        i, i == 2 ? schemas::AttemptResult::kFailed : schemas::AttemptResult::kDone));
  }
  schemas::FarmEnd end;
  end.state = schemas::FarmEnd::State::kFailed;
  end.missing_frames = "7-9";
  end.reason = "frames 7-9: it broke";
  end.frames = 12;
  end.ended_utc = utc_now();
  folder_.write_end(end);
  const JobStatus status = job_status(folder_);
  EXPECT_EQ(status.state, JobState::kFailed);
  EXPECT_EQ(status.frames_done, 9);
  EXPECT_EQ(status.frames_failed, 3);
  const auto document = nlohmann::json::parse(status_json(status));
  EXPECT_EQ(document["missing_frames"], "7-9");
  EXPECT_EQ(document["tasks"][4]["attempts"][0]["end"]["result"], "failed");
  EXPECT_THAT(status_html(status, folder_), HasSubstr("it broke"));
}

TEST_F(Status, OfALocalJobIsThatOfItsProcess) {
  const testing::TestFolder parent;
  const JobFolder folder =
      testing::write_small_job(parent.path(), schemas::FarmJobDocument::Engine::kLocal);
  EXPECT_EQ(job_status(folder).state, JobState::kNotQueued);
  SchedulerAnswer answer;
  answer.is_local_job_running = true;
  EXPECT_EQ(job_status(folder, answer).state, JobState::kRunning);
  EXPECT_EQ(job_status(folder, SchedulerAnswer{}).state, JobState::kUnknown);
}

}  // namespace
}  // namespace raystage::farm
