// SPDX-License-Identifier: Apache-2.0
// Tests farm jobs on this machine, which run the same tasks as on a cluster in sequence.
#include <algorithm>

#include "farm/slurm_scripts.h"
#include "testing/test_paths.h"
#include "tests/farm/farm_job_test.h"

namespace raystage::testing {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

class FarmLocal : public FarmJobTest {
 protected:
  /// Runs a template as a render manager does: each step's command for every value of its range.
  void run_openjd_session(std::string file) const {
    file.pop_back();  // the line break
    const auto document = nlohmann::json::parse(read_text(folder_ / file));
    write_text(folder_ / "rules.json", R"({"version": "pathmapping-1.0"})");
    const auto filled_in = [&](std::string word, int task) {
      const auto& parameters = document["parameterDefinitions"];
      word = replaced(word, "{{Param.JobFolder}}", parameters[0]["default"]);
      word = replaced(word, "{{Param.Raystage}}", parameters[1]["default"]);
      word = replaced(word, "{{Task.Param.Task}}", std::to_string(task));
      word = replaced(word, "{{Session.PathMappingRulesFile}}", (folder_ / "rules.json").string());
      return farm::shell_quote(word);
    };
    for (const auto& step : document["steps"]) {
      int tasks = 1;
      if (step.contains("parameterSpace")) {
        const std::string range = step["parameterSpace"]["taskParameterDefinitions"][0]["range"];
        tasks = std::stoi(range.substr(range.find('-') + 1)) + 1;
      }
      const auto& run = step["script"]["actions"]["onRun"];
      for (int task = 0; task < tasks; ++task) {
        std::string command = filled_in(run["command"], task);
        for (const std::string word : run["args"]) command += " " + filled_in(word, task);
        const CommandResult ran = here(command);
        EXPECT_EQ(ran.exit_code, 0) << command << ran.err;
      }
    }
  }
};

TEST_F(FarmLocal, AJobGivesTheFramesOfAPlainRender) {
  const CommandResult farm = here(
      "raystage farm submit 'show dir/shot.json' -o 'o u t/s.####.exr' --engine local --chunk 20 "
      "--preview-first");
  ASSERT_EQ(farm.exit_code, 0) << farm.err;
  EXPECT_THAT(farm.out, HasSubstr("o u t/s.farm/job-0001\n"));
  EXPECT_THAT(farm.err, HasSubstr("Progress: 100%"));
  ASSERT_EQ(
      here("raystage render -q 'show dir/shot.json' -o plain/s.####.exr --simd avx2").exit_code, 0);
  EXPECT_TRUE(frames_in(folder_ / "o u t") == frames_in(folder_ / "plain"));
  const auto job = folder_ / "o u t" / "s.farm" / "job-0001";
  EXPECT_TRUE(std::filesystem::exists(job / "preview.mp4"));
  EXPECT_TRUE(std::filesystem::exists(job / "contact-sheet.png"));
  const auto report = status("o u t/s.####.exr");
  EXPECT_EQ(report["state"], "done");
  EXPECT_EQ(report["frames_done"], 48);
  EXPECT_EQ(report["tasks"][0]["frames"], "1-41x10") << "every tenth frame first";
  const CommandResult page = here("raystage farm status 'o u t/s.####.exr' --html page.html");
  EXPECT_THAT(page.out, HasSubstr(": done\n"));
  EXPECT_THAT(read_text(folder_ / "page.html"), HasSubstr("48 of 48 frames done"));
  // No temporary files are left.
  EXPECT_TRUE(find_files(folder_, ".tmp").empty());
}

TEST_F(FarmLocal, ImportedDepthsTakeThePlaceOfEstimatedOnesInEveryTask) {
  write_shot("deep", 6, 1, "depth");
  ASSERT_EQ(here("raystage export depth -q 'show dir/take' -o maps && rm -rf 'show dir/take/depth' "
                 "&& raystage import -q --depth 'show dir/take' maps")
                .exit_code,
            0);
  const CommandResult farm = here(
      "raystage farm submit 'show dir/deep.json' -o out/s.####.exr --engine local --chunk 2 "
      "--no-preview --no-measure");
  ASSERT_EQ(farm.exit_code, 0) << farm.err;
  EXPECT_EQ(status("out/s.####.exr")["frames_done"], 6);
  EXPECT_FALSE(std::filesystem::exists(folder_ / "show dir/take/depth")) << "nothing is estimated";
  ASSERT_EQ(
      here("raystage render -q 'show dir/deep.json' -o plain/s.####.exr --simd avx2").exit_code, 0);
  EXPECT_TRUE(frames_in(folder_ / "out") == frames_in(folder_ / "plain"));
  // Frames of other maps are other frames: nothing of an earlier run is kept in their place.
  ASSERT_EQ(here("raystage import -q --depth 'show dir/take' maps --depth-existing overwrite "
                 "--depth-unit 1.2")
                .exit_code,
            0);
  const CommandResult again =
      here("raystage render 'show dir/deep.json' -o plain/s.####.exr --simd avx2 --existing skip");
  EXPECT_EQ(again.exit_code, 0) << again.err;
  EXPECT_FALSE(frames_in(folder_ / "out") == frames_in(folder_ / "plain"));
}

TEST_F(FarmLocal, FramesBelowTheLeastCoverageAreNamedAndNotRepeated) {
  const auto shot = folder_ / "show dir" / "shot.json";
  write_text(shot, replaced(read_text(shot), "\"position\": [0.03, 0, 0.1]",
                            "\"position\": [2.5, 0, 0.1]"));  // leaves the array
  const CommandResult farm = here(
      "raystage farm submit 'show dir/shot.json' -o out/s.####.exr --engine local --chunk 12 "
      "--no-preview --no-measure --least-coverage 0.5");
  EXPECT_EQ(farm.exit_code, 4) << farm.err;
  const auto report = status("out/s.####.exr");
  EXPECT_EQ(report["state"], "done");
  EXPECT_EQ(report["frames_done"], 48);
  const std::string below = report["frames_below_coverage"];
  EXPECT_THAT(below, ::testing::EndsWith("-48")) << "the last ones";
  EXPECT_FALSE(below.starts_with("1-"));
  for (const auto& task : report["tasks"]) EXPECT_EQ(task["attempts"].size(), 1U);
  const CommandResult text = here("raystage farm status out/s.####.exr");
  EXPECT_EQ(text.exit_code, 4);
  EXPECT_THAT(text.out, HasSubstr("below the least coverage: frames " + below));
  // A plain render of the same frames names the same ones.
  const CommandResult plain = here(
      "raystage render 'show dir/shot.json' -o out/s.####.exr --existing skip --simd avx2 "
      "--least-coverage 0.5");
  EXPECT_EQ(plain.exit_code, 4);
  EXPECT_THAT(plain.err, HasSubstr("below the least coverage (" + below + ")"));
}

TEST_F(FarmLocal, FramesWithoutRottenCamerasAreNamedAndNotRepeated) {
  for (const char* camera : {"r0c0", "r1c1"}) {
    const auto archive = folder_ / "show dir/take/archive" / (std::string(camera) + ".mkv");
    std::string bytes = read_text(archive);
    bytes[bytes.size() / 2] ^= 1;  // in the middle of 3.6 s, of which the shot shows 0.5 to 2.5 s
    write_text(archive, bytes);
  }
  const CommandResult farm = here(
      "raystage farm submit 'show dir/shot.json' -o out/s.####.exr --engine local --chunk 12 "
      "--no-preview");
  EXPECT_EQ(farm.exit_code, 4) << farm.err;
  const auto report = status("out/s.####.exr");
  EXPECT_EQ(report["state"], "done");
  EXPECT_EQ(report["frames_done"], 48);
  const std::string rotten = report["frames_with_rot"];
  EXPECT_FALSE(rotten.empty());
  for (const auto& task : report["tasks"]) EXPECT_EQ(task["attempts"].size(), 1U);
  const CommandResult text = here("raystage farm status out/s.####.exr");
  EXPECT_EQ(text.exit_code, 4);
  EXPECT_THAT(text.out, HasSubstr("cameras with rotten frames are absent: frames " + rotten));
  const CommandResult refused = here(
      "raystage farm submit 'show dir/shot.json' -o out2/s.####.exr --engine local --chunk 12 "
      "--no-preview --no-measure --rotten error");
  EXPECT_EQ(refused.exit_code, 3) << refused.err;
  const auto failed = status("out2/s.####.exr");
  EXPECT_EQ(failed["missing_frames"], rotten);
  for (const auto& task : failed["tasks"]) {
    EXPECT_EQ(task["attempts"].size(), 1U) << "rot stays, on every node";
  }
}

TEST_F(FarmLocal, DerivesEachInstantOnce) {
  write_shot("freeze", 16, 0, "depth");
  const CommandResult farm = here(
      "raystage farm submit 'show dir/freeze.json' -o out/s.####.exr --engine local --chunk 2 "
      "--no-preview");
  ASSERT_EQ(farm.exit_code, 0) << farm.err;
  auto report = status("out/s.####.exr");
  EXPECT_EQ(report["light_field_frames_solved"], 1) << "one instant, eight chunks";
  int prepared = 0;
  for (const auto& task : report["tasks"]) prepared += task["stage"] == "prepare";
  EXPECT_EQ(prepared, 1);
  // Nothing stays pinned, and nothing is prepared that is stored.
  EXPECT_TRUE(find_files(folder_, "pin.").empty());
  ASSERT_EQ(here("raystage farm submit 'show dir/freeze.json' -o out2/s.####.exr --engine local "
                 "--no-preview")
                .exit_code,
            0);
  report = status("out2/s.####.exr");
  EXPECT_EQ(report["light_field_frames_solved"], 0);
  EXPECT_EQ(report["tasks"][0]["stage"], "render");
}

TEST_F(FarmLocal, TriesAgainWhatFailsAndWithMoreMemoryWhatRanOutOfIt) {
  replace_render_program(R"(
echo "$@" >>'calls'
case "$*" in
  *"--frames=11-20 "*) [ -e failed-2 ] || { [ ! -e failed-1 ] || touch failed-2; touch failed-1; exit 1; } ;;
  *"--frames=21-30 "*) [ -e starved ] || { touch starved; exit 33; } ;;
esac)");
  const CommandResult farm = here(
      "raystage farm submit 'show dir/shot.json' -o out/s.####.exr --engine local --chunk 10 "
      "--memory 0.4 -j 1 --no-preview");
  ASSERT_EQ(farm.exit_code, 0) << farm.err;
  const auto report = status("out/s.####.exr");
  EXPECT_EQ(report["rounds"], 3);
  EXPECT_EQ(report["tasks"][1]["attempts"].size(), 3U);
  EXPECT_EQ(report["tasks"][2]["attempts"].size(), 2U);
  EXPECT_EQ(report["tasks"][2]["attempts"][0]["end"]["result"], "out_of_memory");
  const std::string calls = read_text(folder_ / "calls");
  EXPECT_THAT(calls, HasSubstr("--frames=21-30 --existing skip"));
  EXPECT_EQ(std::count(calls.begin(), calls.end(), '\n'), 5 + 2 + 1) << calls;
  EXPECT_THAT(calls, HasSubstr("--memory 0.600"));
  const CommandResult logs = here("raystage farm logs out/s.####.exr 12");
  EXPECT_THAT(logs.out, HasSubstr("==> render.0001.01 on "));
  EXPECT_THAT(logs.out, HasSubstr("==> render.0001.03 on "));
  EXPECT_EQ(frames_in(folder_ / "out").size(), 48U);
}

TEST_F(FarmLocal, GivesUpWhatFailsForGoodAndRetriesWhenAsked) {
  replace_render_program(R"(case "$*" in *"--frames=11-20 "*) [ -e mended ] || exit 1 ;; esac)");
  const CommandResult farm = here(
      "raystage farm submit 'show dir/shot.json' -o out/s.####.exr --engine local --chunk 10 "
      "--attempts 2 --no-preview");
  EXPECT_EQ(farm.exit_code, 3);
  auto report = status("out/s.####.exr");
  EXPECT_EQ(report["state"], "failed");
  EXPECT_EQ(report["missing_frames"], "11-20");
  EXPECT_EQ(here("raystage farm status out/s.####.exr").exit_code, 3);
  write_text(folder_ / "mended", "");
  const CommandResult retried = here("raystage farm retry out/s.####.exr");
  EXPECT_EQ(retried.exit_code, 0) << retried.err;
  report = status("out/s.####.exr");
  EXPECT_EQ(report["state"], "done");
  EXPECT_EQ(frames_in(folder_ / "out").size(), 48U);
}

TEST_F(FarmLocal, RetryRendersWhatWasRemovedOrDamagedAndWhatIsNamed) {
  replace_render_program(R"(echo "$@" >>calls; [ ! -e broken ] || { rm broken; exit 1; })");
  ASSERT_EQ(here("raystage farm submit 'show dir/shot.json' -o out/s.####.exr --engine local "
                 "--chunk 12 --no-preview")
                .exit_code,
            0);
  const auto whole = frames_in(folder_ / "out");
  CommandResult retried = here("raystage farm retry out/s.####.exr");
  EXPECT_EQ(retried.exit_code, 2);
  EXPECT_THAT(retried.err, HasSubstr("every frame is complete"));
  // One frame is gone, another is cut short.
  std::filesystem::remove(folder_ / "out" / "s.0005.exr");
  std::filesystem::resize_file(folder_ / "out" / "s.0040.exr", 2000);
  const CommandResult report = here("raystage farm status out/s.####.exr");
  EXPECT_EQ(report.exit_code, 3);
  EXPECT_THAT(report.out, HasSubstr("missing: frames 5\n"));
  std::filesystem::remove(folder_ / "calls");
  retried = here("raystage farm retry out/s.####.exr");
  EXPECT_EQ(retried.exit_code, 0) << retried.err;
  EXPECT_THAT(retried.out, HasSubstr("round 2: 2 tasks to render"));
  EXPECT_TRUE(frames_in(folder_ / "out") == whole);
  EXPECT_EQ(here("raystage farm status out/s.####.exr").exit_code, 0);
  // Only the named frame is rendered again.
  std::filesystem::remove(folder_ / "calls");
  write_text(folder_ / "broken", "");  // the first attempt fails, and the old frame is complete
  EXPECT_EQ(here("raystage farm retry out/s.####.exr --frames 7,99").exit_code, 0);
  const std::string calls = read_text(folder_ / "calls");
  const auto first = calls.find("--frames=7 --existing overwrite");
  ASSERT_NE(first, std::string::npos) << calls;
  EXPECT_NE(calls.find("--frames=7 --existing overwrite", first + 1), std::string::npos) << calls;
  EXPECT_EQ(std::count(calls.begin(), calls.end(), '\n'), 2) << calls;
  EXPECT_EQ(here("raystage farm retry out/s.####.exr --frames 99").exit_code, 2);
  const CommandResult logs = here("raystage farm logs out/s.####.exr 7 --attempt 9");
  EXPECT_EQ(logs.exit_code, 2);
  EXPECT_THAT(logs.err, HasSubstr("has no attempt 9"));
}

TEST_F(FarmLocal, FramesHaveTheSubmittersUmask) {
  ASSERT_EQ(here("umask 0027 && raystage farm submit 'show dir/shot.json' -o out/s.####.exr "
                 "--engine local --no-queue")
                .exit_code,
            0);
  // A node's daemon has another umask.
  ASSERT_EQ(here("umask 0077 && raystage farm task out/s.farm/job-0001 render 0").exit_code, 0);
  EXPECT_EQ(std::filesystem::status(folder_ / "out" / "s.0001.exr").permissions(),
            std::filesystem::perms(0640));
}

TEST_F(FarmLocal, AQuotaThatIsUsedUpIsTheNodesFault) {
  ASSERT_EQ(here("raystage farm submit 'show dir/shot.json' -o out/s.####.exr --engine local "
                 "--no-queue")
                .exit_code,
            0);
  // Only a write detects the quota. The job folder moves to a folder without one.
  std::filesystem::rename(folder_ / "out" / "s.farm", folder_ / "s.farm");
  const CommandResult task =
      here("BAD_DISK_FOLDER='" + (folder_ / "out").string() +
           "' BAD_DISK='EDQUOT 200000 999' LD_PRELOAD='" + testing::disk_faults_library().string() +
           "' raystage farm task s.farm/job-0001 render 0");
  EXPECT_NE(task.exit_code, 0);
  std::filesystem::rename(folder_ / "s.farm", folder_ / "out" / "s.farm");
  const auto report = status("out/s.####.exr");
  const auto& attempt = report["tasks"][0]["attempts"][0];
  ASSERT_TRUE(attempt.contains("end")) << report.dump(1);
  EXPECT_TRUE(attempt["end"].value("node_fault", false)) << attempt.dump(1);
  EXPECT_THAT(attempt["end"]["reason"].get<std::string>(), HasSubstr("Disk quota exceeded"));
  EXPECT_TRUE(find_files(folder_ / "out", ".tmp").empty());
  EXPECT_EQ(here("raystage farm retry out/s.####.exr").exit_code, 0);
  EXPECT_EQ(frames_in(folder_ / "out").size(), 48U);
}

TEST_F(FarmLocal, StaleHandlesAreAwaited) {
  ASSERT_EQ(here("raystage farm submit 'show dir/shot.json' -o out/s.####.exr --engine local "
                 "--frames 1-4 --no-preview --no-queue && "
                 "raystage farm task out/s.farm/job-0001 render 0")
                .exit_code,
            0);
  const std::string verify = "BAD_DISK_FOLDER='" + (folder_ / "out").string() +
                             "' BAD_DISK='ESTALE 0 2' LD_PRELOAD='" +
                             testing::disk_faults_library().string() +
                             "' raystage farm task out/s.farm/job-0001 verify --patience ";
  // Let only frames fail: the job's records are in the same folder, and a task needs them to start.
  std::filesystem::rename(folder_ / "out" / "s.farm", folder_ / "s.farm");
  const auto moved = [&](const std::string& patience) {
    return here(replaced(verify, "out/s.farm", "s.farm") + patience);
  };
  EXPECT_EQ(moved("0").exit_code, 3) << "the frames cannot be read";
  EXPECT_EQ(moved("60").exit_code, 0) << "they can, two seconds later";
}

TEST_F(FarmLocal, WordsBeforeTheCommandRunIt) {
  // A command prefix like that of a container, with a quoted argument and its own program.
  write_text(folder_ / "in box", "#!/bin/sh\n[ \"$1\" = 'a b' ] || exit 9\nshift\nexec \"$@\"\n");
  std::filesystem::permissions(folder_ / "in box", std::filesystem::perms::all);
  const CommandResult made = here(
      "raystage farm export --openjd 'show dir/shot.json' -o out/s.####.exr --frames 1-4 "
      "--no-preview --program raystage --command-prefix \"'" +
      (folder_ / "in box").string() + "' 'a b'\"");
  ASSERT_EQ(made.exit_code, 0) << made.err;
  run_openjd_session(made.out);
  EXPECT_EQ(status("out/s.####.exr")["state"], "done");
}

TEST_F(FarmLocal, StopsOnASignalAndGoesOnWhenAsked) {
  replace_render_program("[ -e slow ] && sleep 20");
  write_text(folder_ / "slow", "");
  const CommandResult stopped = run_and_signal(
      "bash -c \"cd '" + folder_.string() +
          "'; exec bin/raystage farm submit 'show dir/shot.json' "
          "-o out/s.####.exr --engine local --chunk 24 --no-preview\"",
      SIGTERM, folder_ / "out" / "s.farm" / "job-0001" / "attempts" / "render.0000.01.json");
  EXPECT_EQ(stopped.exit_code, 143) << stopped.err;
  EXPECT_EQ(status("out/s.####.exr")["state"], "stopped");
  std::filesystem::remove(folder_ / "slow");
  EXPECT_EQ(here("raystage farm retry out/s.####.exr").exit_code, 0);
  EXPECT_EQ(frames_in(folder_ / "out").size(), 48U);
}

TEST_F(FarmLocal, RefusesWhatCannotBecomeAJob) {
  const auto refused = [&](const std::string& options, const std::string& because) {
    const CommandResult result =
        here("raystage farm submit 'show dir/shot.json' -o out/s.####.exr " + options);
    EXPECT_EQ(result.exit_code, 2) << options << result.err;
    EXPECT_THAT(result.err, HasSubstr(because)) << options;
    EXPECT_FALSE(std::filesystem::exists(folder_ / "out" / "s.farm")) << options;
  };
  refused("--engine local --frames 100", "none of the frames");
  refused("--engine local --map x=y", "two absolute paths");
  refused("--engine local --sbatch=--exclusive", "a job that Slurm does not run");
  refused("--engine local --map /a=/b", "this host runs the tasks itself");
  refused("--engine local --memory 0.001", "one frame needs");
  write_shot("chosen", 4, 1, "auto", R"({"target_error": 20})");
  const CommandResult automatic =
      here("raystage farm submit 'show dir/chosen.json' -o out/s.####.exr --engine local");
  EXPECT_EQ(automatic.exit_code, 2);
  EXPECT_THAT(automatic.err, HasSubstr("method auto chooses again in every task"));
  EXPECT_EQ(here("raystage farm status nowhere").exit_code, 2);
  EXPECT_EQ(here("raystage farm task nowhere render 0").exit_code, 2);
}

TEST_F(FarmLocal, PathsMayHaveOtherNamesOnTheNodes) {
  std::filesystem::create_directory_symlink(folder_, folder_.string() + ".net");
  const CommandResult farm = here(
      "raystage farm submit 'show dir/shot.json' -o out/s.####.exr "
      "--engine local --no-queue --chunk 48 --map '" +
      folder_.string() + "=" + folder_.string() + ".net'");
  ASSERT_EQ(farm.exit_code, 0) << farm.err;
  const std::string job = read_text(folder_ / "out" / "s.farm" / "job-0001" / "job.json");
  EXPECT_THAT(job, HasSubstr("\"output\": \"" + folder_.string() + ".net/out/s.####.exr\""));
  EXPECT_EQ(here("raystage farm task out/s.farm/job-0001 render 0").exit_code, 0);
  EXPECT_EQ(here("raystage farm task out/s.farm/job-0001 verify").exit_code, 0);
  EXPECT_EQ(frames_in(folder_ / "out").size(), 48U);
  std::filesystem::remove(folder_.string() + ".net");
  // Without the nodes' paths this is the submitting host, which uses its own paths.
  std::filesystem::remove(folder_ / "out" / "s.0009.exr");
  EXPECT_EQ(here("raystage farm status out/s.####.exr").exit_code, 3);
  const CommandResult retried = here("raystage farm retry out/s.####.exr");
  EXPECT_THAT(retried.out, HasSubstr("round 2: 1 tasks to render")) << retried.err;
}

TEST_F(FarmLocal, ReadOnlyTakesGetACacheNextToTheOutput) {
  write_shot("freeze", 2, 0, "depth");
  std::filesystem::create_directories(folder_ / "out");
  std::filesystem::permissions(folder_ / "out", std::filesystem::perms::all);
  const CommandResult farm =
      run("cd '" + folder_.string() +
              "' && raystage farm submit 'show dir/freeze.json' -o out/s.####.exr --engine local",
          {.root = true});
  ASSERT_EQ(farm.exit_code, 0) << farm.err;
  EXPECT_THAT(farm.err, HasSubstr("a take is read-only"));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "show dir" / "take" / "depth"));
  EXPECT_EQ(find_files(folder_ / "out" / "s.farm" / "cache" / "depth", ".zst").size(), 1U);
  EXPECT_EQ(status("out/s.####.exr")["light_field_frames_solved"], 1);
}

TEST_F(FarmLocal, ExportsAJobForOtherRenderManagers) {
  const CommandResult made =
      here("raystage farm export --openjd 'show dir/shot.json' -o out/s.####.exr --chunk 24");
  ASSERT_EQ(made.exit_code, 0) << made.err;
  run_openjd_session(made.out);
  EXPECT_EQ(status("out/s.####.exr")["state"], "done");
  EXPECT_EQ(frames_in(folder_ / "out").size(), 48U);
}

TEST_F(FarmLocal, OtherBuildsAreRefused) {
  ASSERT_EQ(here("raystage farm submit 'show dir/shot.json' -o out/s.####.exr --engine local "
                 "--no-queue")
                .exit_code,
            0);
  replace_render_program("");
  const CommandResult other = here("bin/raystage farm task out/s.farm/job-0001 render 0");
  EXPECT_EQ(other.exit_code, 1);
  const auto report = status("out/s.####.exr");
  EXPECT_THAT(report["tasks"][0]["reason"].get<std::string>(),
              HasSubstr("the job was made with build"));
  EXPECT_EQ(report["excluded_nodes"].size(), 1U);
  EXPECT_EQ(here("bin/raystage farm doctor out/s.####.exr").exit_code, 1);
}

}  // namespace
}  // namespace raystage::testing
