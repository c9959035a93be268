// SPDX-License-Identifier: Apache-2.0
// Tests distributed jobs on a real Slurm cluster: each node has the archive of one camera.
#include <unistd.h>

#include "testing/test_paths.h"
#include "tests/farm/farm_job_test.h"
#include "tests/farm/frame_difference.h"

namespace raystage::testing {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using ::testing::HasSubstr;

class FarmSlurmRanks : public FarmJobTest {
 protected:
  void SetUp() override {
    if (geteuid() != 0) GTEST_SKIP() << "a cluster on one host takes root";
    if (run("command -v slurmctld slurmd munged nsenter mpirun").exit_code != 0) {
      GTEST_SKIP() << "Slurm or OpenMPI is not installed (slurm-wlm, munge, openmpi-bin)";
    }
    if (run("unshare --pid --mount --fork --kill-child --mount-proc true").exit_code != 0) {
      GTEST_SKIP() << "namespaces are refused here";
    }
    FarmJobTest::SetUp();
    const CommandResult started = cluster("start 4");
    ASSERT_EQ(started.exit_code, 0) << started.err;
    give_archives_to_nodes();
  }
  void TearDown() override {
    if (!folder_.empty()) cluster("stop");
    FarmJobTest::TearDown();
  }

  CommandResult cluster(const std::string& verb) const {
    return run(testing::source_folder().string() + "/tests/farm/cluster.sh '" +
               (folder_ / "c").string() + "' " + verb);
  }
  CommandResult on_cluster(const std::string& command) const {
    return here("export SLURM_CONF='" + (folder_ / "c" / "slurm.conf").string() + "'; " + command);
  }

  static std::string node(int index) { return "n" + std::to_string(index + 1); }

  /// Leaves only the documents on the submitting host. Each node sees a take with one camera's
  /// archive under the same name. The complete take moves to "whole", for comparison.
  void give_archives_to_nodes() const {
    const fs::path take = folder_ / "show dir" / "take", whole = folder_ / "whole";
    fs::create_directories(whole);
    fs::rename(take, whole / "take");
    const json document = json::parse(read_text(whole / "take" / "take.json"));
    const auto make = [&](const fs::path& to, int camera) {
      fs::create_directories(to / "archive");
      for (const char* name : {"take.json", "rig.json", "timeline.zst"}) {
        fs::copy_file(whole / "take" / name, to / name);
      }
      for (const char* file : {"archive", "journal"}) {
        if (camera < 0) continue;
        const std::string name = document["cameras"][camera][file];
        fs::copy_file(whole / "take" / name, to / name);
      }
    };
    make(take, -1);
    for (int i = 0; i < 4; ++i) {
      const fs::path own = folder_ / "nodes" / node(i);
      make(own, i);
      const CommandResult bound =
          cluster("on " + node(i) + " mount --bind '" + own.string() + "' '" + take.string() + "'");
      ASSERT_EQ(bound.exit_code, 0) << bound.err;
    }
  }

  CommandResult submit(const std::string& shot, const std::string& more) const {
    return on_cluster(
        "raystage farm submit 'show dir/" + shot +
        ".json' -o out/s.####.exr -j 1 --distributed --nodes 'n[1-4]' --no-preview --mpirun 'env "
        "OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1 mpirun --mca btl tcp,self --mca "
        "btl_tcp_if_include lo --mca oob_tcp_if_include lo' " +
        more);
  }

  json query_status() const {
    return json::parse(on_cluster("raystage farm status --json out/s.####.exr").out);
  }
  json ended() const {
    json status;
    wait_for(240, [&] {
      status = query_status();
      return status["state"] != "running" && status["state"] != "waiting" &&
             status["state"] != "unknown";
    });
    return status;
  }
  std::string logs() const {
    std::string text;
    for (const auto& file : find_files(folder_ / "out" / "s.farm", ".log")) {
      text += "== " + file.filename().string() + "\n" + read_text(file);
    }
    return text;
  }

  void expect_equal_to_local(const std::string& shot, int frames) const {
    fs::copy_file(folder_ / "show dir" / (shot + ".json"), folder_ / "whole" / (shot + ".json"));
    const CommandResult local =
        here("raystage render whole/" + shot +
             ".json -o local/s.####.exr -j 1 --simd avx2 --frames 1-" + std::to_string(frames));
    ASSERT_EQ(local.exit_code, 0) << local.err;
    for (int frame = 1; frame <= frames; ++frame) {
      const std::string number = std::to_string(frame);
      const std::string name = "s." + std::string(4 - number.size(), '0') + number + ".exr";
      const FrameDifference found =
          frame_difference(folder_ / "local" / name, folder_ / "out" / name);
      EXPECT_LE(found.most, 1) << name;
      EXPECT_LE(found.share, 0.01) << name;
      EXPECT_GT(found.brightest, 0.05F) << name;
    }
  }
};

TEST_F(FarmSlurmRanks, RenderAShotWithoutGatheringTheArchives) {
  const CommandResult submitted = submit("shot", "--frames 1-24");
  ASSERT_EQ(submitted.exit_code, 0) << submitted.err;
  const json status = ended();
  EXPECT_EQ(status["state"], "done") << status.dump(1) << logs();
  EXPECT_EQ(status["frames_done"], 24);
  EXPECT_THAT(logs(), HasSubstr("the first of 4 ranks"));
  expect_equal_to_local("shot", 24);
}

TEST_F(FarmSlurmRanks, GoOnAfterARankWasKilled) {
  constexpr int kFrames = 100;  // the first is written long before the last
  write_shot("deep", kFrames, 0.4, "depth", R"({"near": 2, "far": 12})");
  const CommandResult submitted = submit("deep", "");
  ASSERT_EQ(submitted.exit_code, 0) << submitted.err;
  const fs::path first = folder_ / "out" / "s.0001.exr";
  ASSERT_TRUE(wait_for(120, [&] { return fs::exists(first); })) << logs();
  // Linux cuts the names of processes to 15 characters.
  EXPECT_EQ(cluster("on n3 pkill -KILL -x raystage-render").exit_code, 0);
  const auto written = fs::last_write_time(first);
  const json status = ended();
  EXPECT_EQ(status["state"], "done") << status.dump(1) << logs();
  EXPECT_EQ(status["frames_done"], kFrames);
  EXPECT_EQ(fs::last_write_time(first), written) << "whole frames are kept";
  const std::string log = logs();
  EXPECT_NE(log.find("the first of 4 ranks"), log.rfind("the first of 4 ranks")) << log;
  expect_equal_to_local("deep", kFrames);
}

TEST_F(FarmSlurmRanks, MarkCamerasThatNoNodeHasOrFail) {
  fs::remove_all(folder_ / "nodes" / "n2" / "archive");
  fs::create_directories(folder_ / "nodes" / "n2" / "archive");
  ASSERT_EQ(submit("shot", "--frames 1-2").exit_code, 0);
  const json refused = ended();
  EXPECT_EQ(refused["state"], "failed") << refused.dump(1);
  EXPECT_THAT(refused.dump(), HasSubstr("no rank has the archives of 1 of 4 cameras"));
  ASSERT_EQ(submit("shot", "--frames 1-2 --missing-archives absent").exit_code, 0);
  const json status = ended();
  EXPECT_EQ(status["state"], "done") << status.dump(1) << logs();
  EXPECT_THAT(here("exrheader out/s.0001.exr").out, HasSubstr("absentCameras"));
}

TEST_F(FarmSlurmRanks, RefuseWhatTheyCannotRenderBeforeAnythingIsQueued) {
  write_shot("averaged", 2, 1, "depth", R"({"near": 2, "far": 12, "temporal": true})");
  write_shot("chosen", 2, 1, "lumigraph", R"({"proxy": "depth"})");
  for (const char* shot : {"averaged", "chosen"}) {
    const CommandResult refused = submit(shot, "");
    EXPECT_EQ(refused.exit_code, 2) << refused.err;
    EXPECT_THAT(refused.err, HasSubstr("cannot be rendered from archives on several hosts"));
  }
  EXPECT_EQ(submit("shot", "--engine local").exit_code, 2);
  EXPECT_EQ(submit("shot", "--command-prefix 'apptainer exec x'").exit_code, 2);
  const CommandResult unknown = on_cluster(
      "raystage farm submit 'show dir/shot.json' -o out/s.####.exr --distributed --nodes n[3-9]");
  EXPECT_EQ(unknown.exit_code, 2);
  EXPECT_THAT(unknown.err, HasSubstr("there is no node n5"));
  EXPECT_EQ(on_cluster("squeue -h").out, "");
}

}  // namespace
}  // namespace raystage::testing
