// SPDX-License-Identifier: Apache-2.0
#include "farm/job_folder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <set>
#include <thread>

#include "base/atomic_file.h"
#include "base/error.h"
#include "farm/attempts.h"
#include "testing/farm/test_job.h"
#include "testing/test_folder.h"

namespace raystage::farm {
namespace {

TEST(JobFolder, StandsNextToTheOutput) {
  EXPECT_EQ(farm_folder("/out/s_010.####.exr"), "/out/s_010.farm");
  EXPECT_EQ(farm_folder("/out/s_%04d.exr"), "/out/s.farm");
  EXPECT_EQ(farm_folder("/out/@@@@.exr"), "/out/frames.farm");
  EXPECT_EQ(farm_folder("a b/x.#.exr"), "a b/x.farm");
}

TEST(JobFolder, IsGivenToOneSubmissionOnly) {
  const testing::TestFolder parent;
  const std::string output = (parent.path() / "f.####.exr").string();
  std::vector<std::thread> threads;
  std::vector<std::string> made(8);
  for (std::string& path : made) {
    threads.emplace_back([&] { path = create_job_folder(output).path().string(); });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(std::set<std::string>(made.begin(), made.end()).size(), made.size());
}

TEST(JobFolder, ALiveJobIsFoundByItsOutput) {
  const testing::TestFolder parent;
  const std::string output = (parent.path() / "f.####.exr").string();
  EXPECT_FALSE(find_live_job(output));
  const JobFolder folder = testing::write_small_job(parent.path());
  ASSERT_TRUE(find_live_job(output));
  EXPECT_EQ(find_live_job(output)->path(), folder.path());
  EXPECT_FALSE(find_live_job((parent.path() / "f_####.exr").string())) << "another sequence";
  EXPECT_TRUE(find_live_job((parent.path() / "f.%04d.exr").string())) << "the same files";
  EXPECT_FALSE(find_live_job(output, folder.path())) << "no job before it";
  schemas::FarmEnd end;
  end.ended_utc = utc_now();
  folder.write_end(end);
  EXPECT_FALSE(find_live_job(output));
  folder.reopen();
  EXPECT_TRUE(find_live_job(output));
  EXPECT_TRUE(std::filesystem::exists(folder.path() / "ended.1.json"));
}

TEST(JobFolder, ADamagedFrameRangeOfItsEndNamesTheFile) {
  const testing::TestFolder parent;
  const JobFolder folder = testing::write_small_job(parent.path());
  schemas::FarmEnd end;
  end.ended_utc = utc_now();
  end.missing_frames = "4-";
  folder.write_end(end);
  try {
    folder.end();
    ADD_FAILURE() << "nothing was thrown";
  } catch (const Error& error) {
    EXPECT_EQ(error.where(), folder.end_file());
    EXPECT_EQ(error.exit_code(), ExitCode::kBadInput);
  }
}

TEST(JobFolder, IsFoundByAnyOfItsNames) {
  const testing::TestFolder parent;
  testing::write_small_job(parent.path());
  const JobFolder second = testing::write_small_job(parent.path());
  EXPECT_EQ(second.path().filename(), "job-0002");
  for (const std::filesystem::path& name :
       {second.path(), second.job_file(), parent.path() / "f.farm", parent.path() / "f.####.exr",
        std::filesystem::path(second.path().string() + "/")}) {
    EXPECT_EQ(find_job(name).path(), second.path()) << name;
  }
  EXPECT_THROW(find_job(parent.path() / "g.####.exr"), Error);
}

TEST(JobFolder, AJobWithMoreFramesThanAShotIsRefused) {
  const testing::TestFolder parent;
  const JobFolder folder = testing::write_small_job(parent.path());
  schemas::FarmJobDocument job = testing::make_small_job(parent.path());
  job.chunks.assign(10, {"1-999999", {}});
  write_file_atomically(folder.job_file(), schemas::format_farm_job(job));
  EXPECT_EQ(folder.job().chunks.size(), 10U);
  job.chunks.assign(11, {"1-999999", {}});
  write_file_atomically(folder.job_file(), schemas::format_farm_job(job));
  try {
    folder.job();
    FAIL() << "it was accepted";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), ::testing::HasSubstr("job.json#/chunks"));
    EXPECT_THAT(error.what(), ::testing::HasSubstr("10999989 frames"));
  }
}

TEST(JobFolder, ExcludedNodesStayWithTheirReasons) {
  const testing::TestFolder parent;
  const JobFolder folder = testing::write_small_job(parent.path());
  folder.exclude("n3", "the disk is full");
  folder.exclude("n3", "another reason");
  folder.exclude("../../evil", "x");
  EXPECT_TRUE(folder.is_excluded("n3"));
  EXPECT_FALSE(folder.is_excluded("n1"));
  EXPECT_FALSE(std::filesystem::exists(parent.path() / "evil"));
  ASSERT_EQ(folder.excluded_nodes().size(), 2U);
  EXPECT_EQ(folder.excluded_nodes()[1].second, "the disk is full");
}

TEST(JobFolder, FilesOutsideAreNeverRead) {
  const testing::TestFolder parent;
  const JobFolder folder = testing::write_small_job(parent.path());
  const std::filesystem::path outside = parent.path() / "outside";
  create_folder(outside);
  for (const char* const name : {"id_rsa", "render.0000.01.json", "render.0000.01.log"}) {
    write_file_atomically(outside / name, "TOPSECRET");
  }
  for (const auto& inside : {folder.excluded(), folder.attempts(), folder.logs()}) {
    std::filesystem::remove(inside);
    std::filesystem::create_directory_symlink(outside, inside);
  }
  EXPECT_TRUE(folder.excluded_nodes().empty());
  EXPECT_TRUE(read_attempts(folder).empty());
  schemas::FarmAttempt attempt;
  attempt.stage = "render";
  attempt.attempt = 1;
  ASSERT_TRUE(file_exists(attempt_log(folder, attempt)));
  EXPECT_FALSE(read_record(folder.contained(attempt_log(folder, attempt))));
  EXPECT_FALSE(read_record(folder.contained(folder.path() / ".." / "outside" / "id_rsa")));
  // The job folder itself may be a link.
  const JobFolder linked(parent.path() / "link");
  std::filesystem::create_directory_symlink(folder.path(), linked.path());
  EXPECT_EQ(linked.job().chunks.size(), folder.job().chunks.size());
}

}  // namespace
}  // namespace raystage::farm
