// SPDX-License-Identifier: Apache-2.0
#include "farm/slurm_scripts.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

#include "base/child_process.h"
#include "farm/slurm_queue.h"
#include "testing/farm/test_job.h"
#include "testing/test_folder.h"

namespace raystage::farm {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

/// Returns the errors that /bin/sh finds in a script without running it.
std::string shell_complaint(const std::string& script) {
  ChildOptions options;
  options.input = script;
  const ChildResult result = run_child({"sh", "-n"}, options);
  return result.exit_code == 0 ? "" : result.out;
}

TEST(SlurmScripts, AreShellWhateverThePathsAre) {
  schemas::FarmJobDocument job = testing::make_small_job("/a b/it's $HOME \"x\"/`id`");
  job.program = "/opt/my programs/raystage";
  job.command_prefix = "apptainer exec /net/x.sif";
  for (const schemas::FarmStage stage : schemas::kFarmStages) {
    EXPECT_EQ(shell_complaint(batch_script(job, stage)), "");
  }
  EXPECT_EQ(shell_complaint(round_script(job, testing::first_round())), "");
  EXPECT_EQ(shell_complaint(start_script(job, "other-12345678")), "");
  EXPECT_EQ(shell_complaint(queue_start_script(job)), "");
  EXPECT_EQ(shell_complaint(preview_script(job, testing::first_round())), "");
  ChildOptions options;
  options.input = "printf %s " + shell_quote(job.folder);
  EXPECT_EQ(run_child({"sh"}, options).out, job.folder);
}

TEST(SlurmScripts, AskForNoMoreTimeThanThePartitionAllows) {
  EXPECT_EQ(parse_slurm_minutes("1-00:30:00"), 1470);
  EXPECT_EQ(parse_slurm_minutes("2:00:00"), 120);
  EXPECT_EQ(parse_slurm_minutes("30:00"), 30);
  EXPECT_FALSE(parse_slurm_minutes("infinite"));
  schemas::FarmJobDocument job = testing::make_small_job();
  job.max_minutes = 30;
  schemas::FarmRound round = testing::first_round();
  round.time_factor = 2;
  EXPECT_THAT(round_script(job, round), HasSubstr("--time=30 "));
}

TEST(SlurmScripts, AskForWhatAStageMayUse) {
  schemas::FarmJobDocument job = testing::make_small_job();
  job.of(schemas::FarmStage::kRender).options = {"--partition=fast", "--licenses=store:1"};
  const std::string script = batch_script(job, schemas::FarmStage::kRender);
  EXPECT_THAT(script, HasSubstr("#SBATCH --partition=fast\n"));
  EXPECT_THAT(script, HasSubstr("--cpus-per-task=2"));
  EXPECT_THAT(script, HasSubstr("#SBATCH --time=20\n"));
  EXPECT_THAT(script, HasSubstr("#SBATCH --export=NONE\n"));
  EXPECT_THAT(script, HasSubstr("#SBATCH --mem=906M\n"));  // (0.5 * 1.1 + 0.4) GB in MiB
  EXPECT_THAT(batch_script(job, schemas::FarmStage::kVerify), Not(HasSubstr("--partition")));
}

/// A script with false commands of Slurm that record their arguments.
class RoundScript : public ::testing::Test {
 protected:
  std::string run(const schemas::FarmJobDocument& job, const schemas::FarmRound& round) {
    return run_script(round_script(job, round));
  }
  /// Runs a script in the folder "job" and returns the commands that it gave to Slurm.
  std::string run_script(const std::string& script, const std::string& arguments = "",
                         const std::string& squeue = "") {
    const auto bin = folder_.path() / "bin";
    std::filesystem::create_directories(bin);
    write_tool(bin / "squeue", squeue);
    write_tool(bin / "sbatch",
               "n=$(($(cat ../n 2>/dev/null || echo 100) + 1)); echo $n >../n\n"
               "echo \"$@\" >>../calls; echo $n");
    write_tool(bin / "sinfo", "printf 'n1\\nn2\\nn3\\nn4\\n'");
    write_tool(bin / "scontrol",
               "case $2 in hostnames) echo \"$3\" | tr , '\\n' ;; *) echo scontrol \"$@\" "
               ">>../calls ;; esac");
    std::filesystem::create_directories(folder_.path() / "job" / "slurm");
    std::ofstream(folder_.path() / "job" / "round.sh") << script;
    const ChildResult result =
        run_child({"sh", "-c",
                   "PATH=" + bin.string() + ":$PATH sh " +
                       (folder_.path() / "job" / "round.sh").string() + " " + arguments});
    EXPECT_EQ(result.exit_code, 0) << result.out;
    std::ifstream calls(folder_.path() / "calls");
    return {std::istreambuf_iterator<char>(calls), std::istreambuf_iterator<char>()};
  }
  static void write_tool(const std::filesystem::path& file, const std::string& text) {
    std::ofstream(file) << "#!/bin/sh\n" << text << "\n";
    std::filesystem::permissions(file, std::filesystem::perms::all);
  }
  testing::TestFolder folder_;
};

TEST_F(RoundScript, QueuesEachChunkBehindItsInstants) {
  EXPECT_EQ(run(testing::make_small_job(), testing::first_round()),
            "--parsable --hold --array=0-1 prepare.sbatch 1 0\n"
            "--parsable --array=0-1 --dependency=afterany:101_0 render.sbatch 1 0\n"
            "--parsable --array=2 --dependency=afterany:101_1 render.sbatch 1 0\n"
            "--parsable --array=3 render.sbatch 1 0\n"
            "--parsable --dependency=afterany:102:103:104 verify.sbatch 1 0\n"
            "scontrol release 101\n");
}

TEST_F(RoundScript, QueuesNothingTwice) {
  const std::string once = run(testing::make_small_job(), testing::first_round());
  EXPECT_EQ(run(testing::make_small_job(), testing::first_round()),
            once + "scontrol release 101\n");
}

TEST_F(RoundScript, SplitsArraysAndLeavesNodesOut) {
  schemas::FarmJobDocument job = testing::make_small_job();
  job.max_array_size = 3;
  job.instants.clear();
  for (auto& chunk : job.chunks) chunk.instants.clear();
  schemas::FarmRound round;
  round.round = 2;
  round.render = {1, 2, 3};
  round.exclude = {"n3", "n4"};
  round.memory_factor = 1.5;
  round.time_factor = 2;
  const std::string calls = run(job, round);
  EXPECT_THAT(calls,
              HasSubstr("--array=1-2 --mem=1169M --time=40 --exclude=n3,n4 render.sbatch 2 0\n"));
  EXPECT_THAT(calls,
              HasSubstr("--array=0 --mem=1169M --time=40 --exclude=n3,n4 render.sbatch 2 3\n"));
}

TEST_F(RoundScript, MakesThePreviewWhereTheFramesCanBeRead) {
  schemas::FarmJobDocument job = testing::make_small_job();
  job.of(schemas::FarmStage::kPreview).options = {"--exclude=n1"};
  schemas::FarmRound round;
  round.round = 2;
  EXPECT_EQ(run_script(preview_script(job, round)), "--parsable preview.sbatch 2 0\n");
  round.round = 3;
  round.exclude = {"n3"};
  EXPECT_THAT(run_script(preview_script(job, round)),
              HasSubstr("--parsable --exclude=n3,n1 preview.sbatch 3 0\n"));
  round.round = 4;
  round.exclude = {"n2", "n3", "n4"};  // with n1 all: only what the submission excludes
  EXPECT_THAT(run_script(preview_script(job, round)),
              HasSubstr("--parsable --exclude=n1 preview.sbatch 4 0\n"));
}

/// A job that waits for another one, whose folder is "before".
class WaitingJob : public RoundScript {
 protected:
  void SetUp() override {
    job_.folder = (folder_.path() / "job").string();
    for (const char* name : {"job/logs", "job/rounds", "job/slurm", "before/slurm"}) {
      std::filesystem::create_directories(folder_.path() / name);
    }
    std::ofstream(folder_.path() / "job" / "job.json") << "{}";
    std::ofstream(folder_.path() / "job" / "after") << "../before\n";
    std::ofstream(folder_.path() / "job" / "start.sh") << queue_start_script(job_);
    std::ofstream(folder_.path() / "before" / "slurm" / "verify.1") << "77\n";
  }
  std::string look(const std::string& idle_looks, const std::string& squeue) {
    return run_script(start_script(job_, "before-1"), idle_looks, squeue);
  }
  schemas::FarmJobDocument job_ = testing::make_small_job();
};

TEST_F(WaitingJob, LooksAgainBehindTheNewestVerification) {
  EXPECT_EQ(look("3", "echo 77"),
            "--parsable --dependency=afterany:77 --begin=now+15 start.sbatch 0\n");
}

TEST_F(WaitingJob, CountsLooksAtAJobThatIsNoLongerQueued) {
  EXPECT_EQ(look("3", ""), "--parsable --dependency=afterany:77 --begin=now+15 start.sbatch 4\n");
  EXPECT_FALSE(std::filesystem::exists(folder_.path() / "job" / "ended.json"));
}

TEST_F(WaitingJob, EndsWhereTheOtherIsStalled) {
  EXPECT_EQ(look("19", ""), "") << "nothing is queued";
  const JobFolder folder(folder_.path() / "job");
  ASSERT_TRUE(folder.end());
  EXPECT_EQ(folder.end()->state, schemas::FarmEnd::State::kFailed);
  EXPECT_THAT(folder.end()->reason, HasSubstr("stalled"));
}

TEST_F(WaitingJob, StartsOnceTheOtherIsOver) {
  write_round(JobFolder(folder_.path() / "job"), job_, testing::first_round());
  std::ofstream(folder_.path() / "before" / "ended.json") << "{}";
  EXPECT_THAT(look("0", ""), HasSubstr("--hold --array=0-1 prepare.sbatch 1 0\n"));
}

}  // namespace
}  // namespace raystage::farm
