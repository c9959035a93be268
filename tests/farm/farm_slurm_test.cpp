// SPDX-License-Identifier: Apache-2.0
// Tests farm jobs on a real Slurm cluster.
#include <unistd.h>

#include <algorithm>
#include <iostream>
#include <set>

#include "testing/test_paths.h"
#include "tests/farm/farm_job_test.h"

namespace raystage::testing {
namespace {

using nlohmann::json;
using ::testing::HasSubstr;

constexpr double kJobSeconds = 240;  // a busy machine is no fault

class FarmSlurm : public FarmJobTest {
 protected:
  void SetUp() override {
    if (geteuid() != 0) GTEST_SKIP() << "a cluster on one host takes root";
    if (run("command -v slurmctld slurmd munged nsenter").exit_code != 0) {
      GTEST_SKIP() << "Slurm is not installed (slurm-wlm, munge)";
    }
    if (run("unshare --pid --mount --fork --kill-child --mount-proc true").exit_code != 0) {
      GTEST_SKIP() << "namespaces are refused here";
    }
    FarmJobTest::SetUp();
  }
  void TearDown() override {
    if (!folder_.empty()) {
      if (HasFailure()) std::cout << "Slurm:\n" << cluster("report").out;
      cluster("stop");
    }
    FarmJobTest::TearDown();
  }
  CommandResult cluster(const std::string& verb) const {
    return run(testing::source_folder().string() + "/tests/farm/cluster.sh '" +
               (folder_ / "c").string() + "' " + verb);
  }
  void start(const std::string& more = "") const {
    const CommandResult started = cluster("start 4 " + more);
    ASSERT_EQ(started.exit_code, 0) << started.err;
  }
  CommandResult on_cluster(const std::string& command) const {
    return here("export SLURM_CONF='" + (folder_ / "c" / "slurm.conf").string() + "'; " + command);
  }
  /// Gives this node a full disk as its output disk; the job folder stays on the shared disk.
  void fill_disk_of(const std::string& node) const {
    const std::string out = (folder_ / "out").string();
    const CommandResult filled =
        cluster("on " + node + " sh -c \"mkdir /tmp/kept.$$ && mount --bind " + out +
                "/s.farm /tmp/kept.$$ && mount -t tmpfs -o size=64k none " + out + " && mkdir " +
                out + "/s.farm && mount --bind /tmp/kept.$$ " + out + "/s.farm\"");
    ASSERT_EQ(filled.exit_code, 0) << filled.err;
  }
  json query_status(const std::string& output = "out/s.####.exr") const {
    return json::parse(on_cluster("raystage farm status --json '" + output + "'").out);
  }
  bool is_over(double seconds = kJobSeconds) const {
    return wait_for(seconds, [&] {
      const json status = query_status();
      return status["state"] != "running" && status["state"] != "waiting" &&
             status["state"] != "unknown";
    });
  }
  static std::set<std::string> nodes_of(const json& status, const std::string& stage) {
    std::set<std::string> nodes;
    for (const json& task : status["tasks"]) {
      if (task["stage"] != stage) continue;
      for (const json& attempt : task["attempts"]) nodes.insert(attempt["node"].get<std::string>());
    }
    return nodes;
  }
  std::string logs() const {
    std::string text;
    for (const auto& file : find_files(folder_ / "out" / "s.farm", ".log")) {
      text += "== " + file.filename().string() + "\n" + read_text(file);
    }
    return text;
  }
};

/// Tests the faults of a farm, with each of the Slurm settings of sites.
struct Site {
  const char* name;
  const char* settings;
};
class FarmSlurmDisaster : public FarmSlurm, public ::testing::WithParamInterface<Site> {};

TEST_P(FarmSlurmDisaster, TheSequenceIsThatOfOneMachine) {
  start(GetParam().settings);
  replace_render_program(R"(
case "$*" in
  *"--frames=21-24 "*) [ -e ')" +
                         folder_.string() + R"(/f2' ] || {
    [ ! -e ')" + folder_.string() +
                         R"(/f1' ] || touch ')" + folder_.string() + R"(/f2'
    touch ')" + folder_.string() +
                         R"(/f1'; exit 1; } ;;
esac
sleep 1)");
  const CommandResult submitted = on_cluster(
      "raystage farm submit 'show dir/shot.json' -o out/s.####.exr --chunk 4 -j 1 --no-measure "
      "--no-queue");
  ASSERT_EQ(submitted.exit_code, 0) << submitted.err;
  fill_disk_of("n3");
  ASSERT_EQ(on_cluster("sh out/s.farm/job-0001/round-1.sh").exit_code, 0);

  // A node dies in the middle of a task.
  ASSERT_TRUE(wait_for(60, [&] { return nodes_of(query_status(), "render").contains("n2"); }));
  cluster("kill-node n2");
  json status = query_status();
  EXPECT_EQ(status["state"], "running");
  // The controller stops and restarts; the finished tasks are still known.
  cluster("kill-controller");
  status = query_status();
  EXPECT_EQ(status["state"], "unknown");
  int done = 0;
  for (const json& task : status["tasks"]) {
    if (task["stage"] != "render") continue;
    const bool has_end = !task["attempts"].empty() && task["attempts"].back().contains("end") &&
                         task["attempts"].back()["end"]["result"] == "done";
    EXPECT_EQ(task["state"] == "done", has_end);
    EXPECT_NE(task["state"], "running") << "only the controller could know";
    done += has_end ? 4 : 0;
  }
  EXPECT_EQ(status["frames_done"], done);
  ASSERT_EQ(cluster("start-controller").exit_code, 0);

  ASSERT_TRUE(is_over()) << query_status().dump(1) << logs();
  status = query_status();
  EXPECT_EQ(status["state"], "done") << status.dump(1) << logs();
  EXPECT_EQ(status["frames_done"], 48);
  // At most two tasks failed on the full disk, and each of them ran again on another node.
  int failed_on_full_disk = 0, failed_twice = 0;
  for (const json& task : status["tasks"]) {
    if (task["stage"] != "render") continue;
    for (const json& attempt : task["attempts"]) {
      const bool failed = attempt.contains("end") && attempt["end"]["result"] == "failed";
      failed_on_full_disk += attempt.contains("end") && attempt["node"] == "n3" &&
                             attempt["end"].value("node_fault", false);
      failed_twice += failed && attempt["node"] != "n3";
    }
  }
  EXPECT_GE(failed_on_full_disk, 1) << "the test tests nothing";
  EXPECT_LE(failed_on_full_disk, 2);
  EXPECT_EQ(failed_twice, 2);
  EXPECT_THAT(status["excluded_nodes"]["n3"].get<std::string>(),
              HasSubstr("the disk has room for"));
  // Byte for byte what one machine renders.
  ASSERT_EQ(run("cd '" + folder_.string() +
                "' && raystage render -q 'show dir/shot.json' "
                "-o plain/s.####.exr --simd avx2")
                .exit_code,
            0);
  EXPECT_TRUE(frames_in(folder_ / "out") == frames_in(folder_ / "plain"));
  EXPECT_TRUE(wait_for(60, [&] {
    return std::filesystem::exists(folder_ / "out/s.farm/job-0001/contact-sheet.png");
  })) << logs();
}

INSTANTIATE_TEST_SUITE_P(Sites, FarmSlurmDisaster,
                         ::testing::Values(Site{"forgetful", "MinJobAge=2"},  // and no RequeueExit
                                           Site{"defaults", "MinJobAge=300 RequeueExit=1-3,33"}),
                         [](const auto& site) { return site.param.name; });

TEST_F(FarmSlurm, ANodeOfManySlotsWithAFullDiskFailsFewTasks) {
  ASSERT_EQ(setenv("CPUS", "4", 1), 0);
  start("MinJobAge=2");
  unsetenv("CPUS");
  replace_render_program("sleep 1");
  ASSERT_EQ(on_cluster("raystage farm submit 'show dir/shot.json' -o out/s.####.exr --chunk 2 -j 1 "
                       "--memory 0.3 --no-measure --no-preview --no-queue")
                .exit_code,
            0);
  fill_disk_of("n1");
  ASSERT_EQ(on_cluster("sh out/s.farm/job-0001/round-1.sh").exit_code, 0);
  ASSERT_TRUE(is_over()) << query_status().dump(1) << logs();
  const json status = query_status();
  EXPECT_EQ(status["state"], "done") << status.dump(1) << logs();
  EXPECT_TRUE(status["excluded_nodes"].contains("n1")) << "the test tests nothing";
  // Its four slots start at once: the first task that checks the node excludes it for the others.
  int failed_there = 0, ran_there = 0;
  for (const json& task : status["tasks"]) {
    for (const json& attempt : task["attempts"]) {
      if (attempt["node"] != "n1" || task["stage"] != "render") continue;
      ASSERT_TRUE(attempt.contains("end"));
      failed_there += attempt["end"].value("node_fault", false);
      ran_there += attempt["end"]["result"] != "declined";
    }
  }
  EXPECT_EQ(failed_there, 1) << status.dump(1);
  EXPECT_EQ(ran_there, 0) << status.dump(1);
}

TEST_F(FarmSlurm, WhatSlurmWouldRejectIsRefusedBeforeAnythingIsRendered) {
  start();
  for (const char* options : {"--partition nowhere", "--account nobody --partition nowhere",
                              "-j 64", "--memory 100", "--sbatch=--nonsense"}) {
    const CommandResult refused = on_cluster(
        std::string("raystage farm submit 'show dir/shot.json' -o out/s.####.exr ") + options);
    EXPECT_EQ(refused.exit_code, 2) << options << refused.err;
    EXPECT_THAT(refused.err, HasSubstr("Slurm would reject a task of stage")) << options;
    EXPECT_FALSE(std::filesystem::exists(folder_ / "out" / "s.farm")) << options;
    EXPECT_TRUE(frames_in(folder_ / "out").empty()) << options;
  }
  const CommandResult stage = on_cluster(
      "raystage farm submit 'show dir/shot.json' -o out/s.####.exr --partition redner:fast");
  EXPECT_EQ(stage.exit_code, 2);
  EXPECT_THAT(stage.err, HasSubstr("there is no stage \"redner\""));
  const CommandResult plan =
      on_cluster("raystage farm submit 'show dir/shot.json' -o out/s.####.exr --dry-run");
  EXPECT_EQ(plan.exit_code, 0) << plan.err;
  EXPECT_THAT(plan.out, HasSubstr("will render frame 1 on this machine first"));
  EXPECT_THAT(plan.out, ::testing::ContainsRegex("render +[0-9]+ +1 ")) << "nodes have one CPU";
}

TEST_F(FarmSlurm, ATaskThatSlurmEndsIsRecordedAndGetsMoreTime) {
  start();
  replace_render_program("[ -e '" + folder_.string() + "/f' ] || { touch '" + folder_.string() +
                         "/f'; sleep 100; }");
  ASSERT_EQ(on_cluster("raystage farm submit 'show dir/shot.json' -o out/s.####.exr --frames 1-4 "
                       "--chunk 4 -j 1 --time 20 --no-measure --no-preview")
                .exit_code,
            0);
  ASSERT_TRUE(wait_for(60, [&] { return std::filesystem::exists(folder_ / "f"); }));
  // Send TERM to all processes of the task, as at a time limit, which is at least a minute.
  ASSERT_EQ(on_cluster("scancel --full --signal=TERM $(cat out/s.farm/job-0001/slurm/render.1.1)")
                .exit_code,
            0);
  ASSERT_TRUE(is_over()) << query_status().dump(1) << logs();
  const json status = query_status();
  EXPECT_EQ(status["state"], "done") << status.dump(1) << logs();
  EXPECT_EQ(status["tasks"][0]["attempts"][0]["end"]["result"], "stopped") << status.dump(1);
  EXPECT_THAT(read_text(folder_ / "out/s.farm/job-0001/round-2.sh"), HasSubstr("--time=40"));
}

TEST_F(FarmSlurm, AProgramThatNodesLackEndsTheJobWithThatReason) {
  start();
  ASSERT_EQ(on_cluster("raystage farm submit 'show dir/shot.json' -o out/s.####.exr --chunk 12 "
                       "-j 1 --no-measure --program /nowhere/raystage")
                .exit_code,
            0);
  ASSERT_TRUE(is_over()) << query_status().dump(1) << logs();
  const json status = query_status();
  EXPECT_EQ(status["state"], "failed") << status.dump(1) << logs();
  EXPECT_THAT(status["reason"].get<std::string>(), HasSubstr("exit code 127"));
  const CommandResult shown = on_cluster("raystage farm logs out/s.####.exr 1");
  EXPECT_THAT(shown.out, HasSubstr("/nowhere/raystage"));
}

TEST_F(FarmSlurm, AFreezeDerivesItsInstantOnceAndAMoveItsInstantsSideBySide) {
  start("RequeueExit=75 MinJobAge=86400");
  write_shot("freeze", 16, 0, "depth");
  ASSERT_EQ(
      on_cluster("raystage farm submit 'show dir/freeze.json' -o out/s.####.exr --chunk 2 -j 1 "
                 "--no-measure --no-preview")
          .exit_code,
      0);
  ASSERT_TRUE(is_over());
  json status = query_status();
  EXPECT_EQ(status["state"], "done") << status.dump(1) << logs();
  EXPECT_EQ(status["light_field_frames_solved"], 1);
  std::filesystem::remove_all(folder_ / "out");
  write_shot("move", 16, 2.4, "depth");  // a tick for every frame
  ASSERT_EQ(on_cluster("raystage farm submit 'show dir/move.json' -o out/s.####.exr --chunk 4 -j 1 "
                       "--no-measure --no-preview")
                .exit_code,
            0);
  ASSERT_TRUE(is_over());
  status = query_status();
  EXPECT_EQ(status["state"], "done") << status.dump(1) << logs();
  int prepared = 0;
  for (const json& task : status["tasks"]) prepared += task["stage"] == "prepare";
  EXPECT_GE(prepared, 14);
  EXPECT_EQ(status["light_field_frames_solved"], prepared);
  EXPECT_EQ(nodes_of(status, "prepare").size(), 4U);
  EXPECT_TRUE(find_files(folder_, "pin.").empty());
}

TEST_F(FarmSlurm, OneLiveJobAnOutputAndTheNextBehindIt) {
  start();
  replace_render_program("sleep 2");
  const std::string submit =
      "raystage farm submit 'show dir/shot.json' -o out/s.####.exr --chunk 24 -j 1 --no-measure "
      "--no-preview --existing overwrite ";
  ASSERT_EQ(on_cluster(submit).exit_code, 0);
  const CommandResult second = on_cluster(submit);
  EXPECT_EQ(second.exit_code, 2);
  EXPECT_THAT(second.err, HasSubstr("job-0001"));
  EXPECT_THAT(second.err, HasSubstr("a job of this output is not over: s-"));
  const CommandResult after = on_cluster(submit + "--after");
  ASSERT_EQ(after.exit_code, 0) << after.err;
  json status = query_status("out/s.farm/job-0002");
  EXPECT_EQ(status["state"], "waiting");
  EXPECT_EQ(status["reason"], "it waits for the job before it");
  EXPECT_EQ(on_cluster("raystage farm retry out/s.farm/job-0001").exit_code, 2) << "both are live";
  ASSERT_TRUE(
      wait_for(kJobSeconds, [&] { return query_status("out/s.farm/job-0002")["state"] == "done"; }))
      << query_status("out/s.farm/job-0002").dump(1) << logs();
  EXPECT_EQ(query_status("out/s.farm/job-0001")["state"], "done");
  // A cancelled job leaves no task in the queue.
  ASSERT_EQ(on_cluster(submit).exit_code, 0);
  EXPECT_EQ(on_cluster("raystage farm cancel out/s.####.exr").exit_code, 0);
  EXPECT_EQ(query_status()["state"], "cancelled");
  EXPECT_TRUE(wait_for(20, [&] { return on_cluster("squeue -h").out.empty(); }));
  EXPECT_EQ(on_cluster("raystage farm cancel out/s.####.exr").exit_code, 2);
}

TEST_F(FarmSlurm, TheDoctorAsksEveryNode) {
  start();
  ASSERT_EQ(on_cluster("raystage farm submit 'show dir/shot.json' -o out/s.####.exr --no-measure "
                       "--no-queue")
                .exit_code,
            0);
  CommandResult doctor = on_cluster("raystage farm doctor out/s.####.exr --wait 60");
  EXPECT_EQ(doctor.exit_code, 0) << doctor.out << doctor.err;
  for (const char* node : {"n1 ", "n2 ", "n3 ", "n4 "}) EXPECT_THAT(doctor.out, HasSubstr(node));
  cluster("kill-node n2");
  cluster("on n4 mount -t tmpfs none '" + (folder_ / "show dir").string() + "'");
  cluster("on n3 mount -t tmpfs -o size=16k none '" + (folder_ / "show dir").string() + "'");
  doctor = on_cluster("raystage farm doctor out/s.####.exr --nodes n1,n2,n9");
  EXPECT_EQ(doctor.exit_code, 1);
  EXPECT_THAT(doctor.out, HasSubstr("Slurm: down"));
  EXPECT_THAT(doctor.out, HasSubstr("Slurm has no node of this name"));
  doctor = on_cluster("raystage farm doctor out/s.####.exr --nodes n1,n3,n4");
  EXPECT_EQ(doctor.exit_code, 1);
  EXPECT_THAT(doctor.out, ::testing::ContainsRegex("n1 .*ready"));
  EXPECT_THAT(doctor.out, ::testing::ContainsRegex("n3 .*take.json: cannot be read"));
  EXPECT_THAT(doctor.out, ::testing::ContainsRegex("n4 .*take.json: cannot be read"));
}

TEST_F(FarmSlurm, NodesWithoutTheJobsFolderAreLeftAndALostVerificationIsQueuedAnew) {
  start("MinJobAge=2");
  replace_render_program("sleep 1");
  ASSERT_EQ(on_cluster("raystage farm submit 'show dir/shot.json' -o out/s.####.exr --chunk 4 -j 1 "
                       "--no-measure --no-preview --no-queue")
                .exit_code,
            0);
  ASSERT_EQ(cluster("on n1 mount -t tmpfs none '" + (folder_ / "out").string() + "'").exit_code, 0);
  ASSERT_EQ(on_cluster("sh out/s.farm/job-0001/round-1.sh").exit_code, 0);
  // Cancel the verification, as a killed controller forgets the tasks that it accepted last.
  ASSERT_EQ(on_cluster("scancel $(cat out/s.farm/job-0001/slurm/verify.1)").exit_code, 0);
  ASSERT_TRUE(is_over()) << query_status().dump(1) << logs();
  const json status = query_status();
  EXPECT_EQ(status["state"], "done") << status.dump(1) << logs();
  EXPECT_FALSE(nodes_of(status, "render").contains("n1"));
  EXPECT_EQ(status["excluded_nodes"]["n1"], "the job folder does not exist on this node");
}

}  // namespace
}  // namespace raystage::testing
