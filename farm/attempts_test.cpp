// SPDX-License-Identifier: Apache-2.0
#include "farm/attempts.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <thread>

#include "testing/farm/test_job.h"
#include "testing/test_folder.h"

namespace raystage::farm {
namespace {

TEST(Attempts, AreNumberedOnceHoweverManyStartAtATime) {
  const testing::TestFolder parent;
  const JobFolder folder = testing::write_small_job(parent.path());
  constexpr int kThreads = 8, kEach = 5;
  std::vector<std::thread> threads;
  for (int i = 0; i < kThreads; ++i) {
    threads.emplace_back([&] {
      for (int j = 0; j < kEach; ++j) {
        schemas::FarmAttempt attempt = testing::make_attempt(2, schemas::AttemptResult::kDone);
        attempt.end.reset();
        record_attempt_start(folder, attempt);
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  const TaskAttempts tasks = read_attempts(folder);
  ASSERT_EQ(tasks.size(), 1U);
  const auto& attempts = tasks.at({"render", 2});
  ASSERT_EQ(attempts.size(), std::size_t{kThreads * kEach});
  for (int i = 0; i < kThreads * kEach; ++i) EXPECT_EQ(attempts[std::size_t(i)].attempt, i + 1);
}

TEST(Attempts, KeepTheirEnd) {
  const testing::TestFolder parent;
  const JobFolder folder = testing::write_small_job(parent.path());
  schemas::FarmAttempt attempt =
      testing::make_attempt(1, schemas::AttemptResult::kFailed, "node 7/ä");
  const auto end = attempt.end;
  attempt.end.reset();
  record_attempt_start(folder, attempt);
  EXPECT_FALSE(read_attempts(folder).at({"render", 1})[0].end);
  attempt.end = end;
  attempt.end->reason = std::string(5000, 'x');
  attempt.end->failed_frames = "4-6";
  record_attempt_end(folder, attempt);
  const schemas::FarmAttempt back = read_attempts(folder).at({"render", 1})[0];
  ASSERT_TRUE(back.end);
  EXPECT_EQ(back.node, "node 7/ä");
  EXPECT_EQ(back.end->failed_frames, "4-6");
  EXPECT_EQ(back.end->reason.size(), 1500U);
}

TEST(Attempts, EndIsWrittenOverItsStartWhereNoFileCanBeCreated) {
  const testing::TestFolder parent;
  const JobFolder folder = testing::write_small_job(parent.path());
  schemas::FarmAttempt attempt = testing::make_attempt(1, schemas::AttemptResult::kDone);
  const auto end = attempt.end;
  attempt.end.reset();
  record_attempt_start(folder, attempt);
  const auto size_before =
      std::filesystem::file_size(folder.attempts() / (attempt_name(attempt) + ".json"));
  attempt.end = end;
  attempt.end->reason = std::string(1400, 'r');
  record_attempt_end(folder, attempt);
  EXPECT_EQ(std::filesystem::file_size(folder.attempts() / (attempt_name(attempt) + ".json")),
            size_before)
      << "an end that is longer than its start needs room that a full disk does not have";
}

TEST(Attempts, ThatAreUnreadableCountWithoutAnEnd) {
  const testing::TestFolder parent;
  const JobFolder folder = testing::write_small_job(parent.path());
  std::ofstream(folder.attempts() / "render.0003.02.json") << "{\"schema";
  std::ofstream(folder.attempts() / "render.0003.json") << "{}";
  std::ofstream(folder.attempts() / "notes.txt") << "x";
  std::filesystem::create_symlink("/etc/passwd", folder.attempts() / "render.0002.01.json");
  const TaskAttempts tasks = read_attempts(folder);
  ASSERT_EQ(tasks.size(), 2U);
  EXPECT_EQ(tasks.at({"render", 3})[0].attempt, 2);
  EXPECT_FALSE(tasks.at({"render", 3})[0].end);
  EXPECT_EQ(tasks.at({"render", 2})[0].node, "unknown") << "a link was followed";
}

}  // namespace
}  // namespace raystage::farm
