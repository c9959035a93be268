// SPDX-License-Identifier: Apache-2.0
// raystage export of takes, as users run it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>

#include <chrono>
#include <csignal>
#include <thread>

#include "base/atomic_file.h"
#include "testing/cli/running_command.h"
#include "testing/cli/test_command.h"
#include "testing/exports/export_test_data.h"
#include "testing/test_paths.h"

namespace raystage::cli::export_takes_test {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using testing::ExportTake;
using ::testing::HasSubstr;
using ::testing::Not;

struct ExportTakes : ::testing::Test {
  /// Runs `raystage export ARGUMENTS` in the folder of the take.
  testing::CommandResult exported(const std::string& arguments) const {
    const std::filesystem::path before = std::filesystem::current_path();
    std::filesystem::current_path(data.folder.path());
    testing::CommandResult result = testing::run_raystage("export " + arguments);
    std::filesystem::current_path(before);
    return result;
  }
  std::string text(const std::string& file) const { return read_file(data.out(file)); }
  bool exists(const std::string& file) const { return std::filesystem::exists(data.out(file)); }
  ExportTake data;
};

TEST_F(ExportTakes, MoviesSayWhatTheyLack) {
  const auto recorded = exported("movies take -o m -q");
  EXPECT_EQ(recorded.exit_code, 0) << recorded.output;
  EXPECT_THAT(recorded.output,
              AllOf(HasSubstr("m: 3 cameras, 21 frames, copy, recorded times\n"),
                    HasSubstr("1 frames are absent (c1 1); nothing stands for them")));
  EXPECT_TRUE(exists("m/c2.mov"));
  const auto constant = exported("movies take -o n -q --times constant --codec ffv1 --fps 30");
  EXPECT_EQ(constant.exit_code, 0) << constant.output;
  EXPECT_THAT(constant.output,
              AllOf(HasSubstr("n: 3 cameras, 48 frames, ffv1, constant times, 30 frames/s\n"),
                    HasSubstr("are absent (c1 "), HasSubstr("others stand for them")));
  EXPECT_TRUE(exists("n/c0.mkv"));
  const auto black = exported("movies take -o b -q --times constant --codec ffv1 --absent black");
  EXPECT_THAT(black.output, HasSubstr("black stands for them"));
}

// A frame that cannot be read is one frame, for however many others it would stand.
TEST_F(ExportTakes, RottenFramesAreCountedOnce) {
  const std::filesystem::path archive = data.folder.path() / "take/archive/c1.mkv";
  const auto last_before_the_lost = store::Take(data.folder.path() / "take").archive(1).frames()[2];
  std::string bytes = read_file(archive);
  bytes[static_cast<std::size_t>(last_before_the_lost.offset) + 40] ^= 1;
  write_file_atomically(archive, bytes);
  for (const std::string policy : {"hold", "black"}) {
    const auto result = exported("images take -o " + policy + " -q --absent " + policy);
    EXPECT_EQ(result.exit_code, 4) << result.output;
    EXPECT_THAT(result.output, HasSubstr("warning: 1 stored frames are not as they were"));
  }
  const auto often = exported("images take -o often -q --fps 80");
  EXPECT_THAT(often.output, HasSubstr("warning: 1 stored frames are not as they were"));
}

TEST_F(ExportTakes, CamerasWithoutArchivesAreLeftOutOnRequest) {
  std::filesystem::remove(data.folder.path() / "take/archive/c2.mkv");
  const auto refused = exported("images take -o none -q");
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_THAT(refused.output, HasSubstr("the archive of camera \"c2\" is missing"));
  for (const std::string form : {"images take -o i", "movies take -o m", "mosaic take -o a.mp4",
                                 "multiview take -o a.mkv", "model take -o model --frame 2"}) {
    const auto result = exported(form + " -q --missing-archives absent");
    EXPECT_EQ(result.exit_code, 0) << form << ": " << result.output;
    EXPECT_THAT(result.output, HasSubstr("the archives of 1 of 3 cameras are missing: c2"));
  }
  EXPECT_TRUE(exists("i/c0/000001.png") || exists("i/c0/000001.jpg"));
  EXPECT_TRUE(exists("m/c1.mov"));
}

TEST_F(ExportTakes, EveryFormHasACommand) {
  EXPECT_EQ(
      exported("images take -o i --format exr --compression zips --frames 1,3-4 -q").exit_code, 0);
  EXPECT_TRUE(exists("i/c1/000003.exr"));
  EXPECT_FALSE(exists("i/c1/000002.exr"));
  EXPECT_FALSE(exists("i/c1/000004.exr"));  // lost
  EXPECT_EQ(exported("mosaic take -o all.mp4 --tile-width 64 -q").exit_code, 0);
  EXPECT_EQ(exported("multiview take -o all.mkv --cameras c2,c0 -q").exit_code, 0);
  EXPECT_EQ(exported("model take -o model --frame 2 -q").exit_code, 0);
  EXPECT_TRUE(exists("model/sparse/0/images.txt"));
  EXPECT_EQ(exported("model take -o nerf --format nerf -q").exit_code, 0);
  EXPECT_FALSE(exists("nerf/sparse"));
  EXPECT_EQ(exported("quilt take -o q.png --columns 2 --rows 1 --view-width 16 -q").exit_code, 0);
  EXPECT_TRUE(exists("q_qs2x1a1.5.png"));
}

TEST_F(ExportTakes, DepthMapsAreImportedOrRefusedWithTheReason) {
  const std::filesystem::path take = data.out("stage");
  ASSERT_EQ(testing::run_raystage("simulate stage -q --rows 2 --columns 2 --width 48 --height 36 "
                                  "--fps 10 --seconds 0.4 --startup-loss-seconds 0 --truth-views 0 "
                                  "-o '" +
                                  take.string() + "'")
                .exit_code,
            0);
  ASSERT_EQ(testing::run_raystage("sync -q '" + take.string() + "'").exit_code, 0);
  ASSERT_EQ(exported("depth stage -o maps -q").exit_code, 0);
  ASSERT_EQ(exported("depth stage -o codes --format png -q").exit_code, 0);
  const auto imported = [&](const std::string& arguments) {
    return testing::run_raystage("import -q --depth '" + take.string() + "' '" +
                                 data.out("").string() + arguments);
  };
  struct Case {
    const char *arguments, *message;
  };
  for (const Case& c :
       {Case{"codes'", "no range or unit was stated"},
        Case{"codes' --depth-near 5 --depth-far 2", "far"},
        Case{"codes' --depth-far 9", "--depth-near"},
        Case{"codes' --depth-near 2 --depth-unit 1", "--depth-unit"},
        Case{"maps' --depth-near 2", "EXR files hold depths"},
        Case{"maps' --depth-unit -1", "--depth-unit"},
        Case{"maps' --depth-channel Q", "no channel Q"},
        Case{"maps' --depth-kind far", "--depth-kind"}, Case{"maps' --rig-only", "--rig-only"},
        Case{"none'", "the folder cannot be read: No such file"}}) {
    const auto refused = imported(c.arguments);
    EXPECT_EQ(refused.exit_code, 2) << c.arguments << refused.output;
    EXPECT_THAT(refused.output, HasSubstr(c.message)) << c.arguments;
  }
  EXPECT_FALSE(std::filesystem::exists(take / "imported_depth" / "maps.json"));
  const auto millimetres = imported("maps' --depth-unit 0.001");
  EXPECT_EQ(millimetres.exit_code, 0) << millimetres.output;
  EXPECT_THAT(millimetres.output,
              AllOf(HasSubstr("(0 replaced)"), HasSubstr("far outside of the take's depth range")));
  const auto again = imported("maps'");
  EXPECT_EQ(again.exit_code, 2);
  EXPECT_THAT(again.output, HasSubstr("has an imported depth map of frame"));
  EXPECT_EQ(imported("maps' --depth-existing overwrite").exit_code, 0);
}

TEST_F(ExportTakes, ImagesBecomeTheSameTakeAgain) {
  ASSERT_EQ(exported("images take -o i -q").exit_code, 0);
  const std::filesystem::path back = data.out("back");
  const auto imported =
      testing::run_raystage("import '" + data.out("i").string() + "' -o '" + back.string() + "'");
  ASSERT_EQ(imported.exit_code, 0) << imported.output;
  const store::Take was = data.take(), is(back);
  for (int camera = 0; camera < ExportTake::kCameras; ++camera) {
    ASSERT_EQ(is.archive(camera).frames().size(), was.archive(camera).frames().size());
    for (std::size_t i = 0; i < is.archive(camera).frames().size(); ++i) {
      EXPECT_EQ(is.archive(camera).frames()[i].time_ns, was.archive(camera).frames()[i].time_ns);
      EXPECT_EQ(is.archive(camera).frames()[i].xxh3, was.archive(camera).frames()[i].xxh3);
    }
  }
  ASSERT_EQ(exported("model take -o model -q").exit_code, 0);
  for (const char* model : {"model", "model/transforms.json"}) {
    const auto rig = data.out(std::string(model) == "model" ? "colmap.json" : "nerf.json");
    const auto read = testing::run_raystage("import '" + data.out(model).string() +
                                            "' --rig-only -o '" + rig.string() + "'");
    ASSERT_EQ(read.exit_code, 0) << read.output;
    const schemas::RigDocument cameras = schemas::read_rig(rig);
    const schemas::RigDocument own = schemas::read_rig(data.path() / "rig.json");
    ASSERT_EQ(cameras.cameras.size(), own.cameras.size());
    for (std::size_t i = 0; i < own.cameras.size(); ++i) {
      EXPECT_EQ(cameras.cameras[i].geometry.id, own.cameras[i].geometry.id);
      EXPECT_EQ(cameras.cameras[i].geometry.intrinsics, own.cameras[i].geometry.intrinsics);
      for (std::size_t k = 0; k < 16; ++k) {
        EXPECT_NEAR(cameras.cameras[i].geometry.world_from_camera[k],
                    own.cameras[i].geometry.world_from_camera[k], 1e-12);
      }
    }
  }
}

TEST_F(ExportTakes, NothingIsReplacedUnasked) {
  ASSERT_EQ(exported("multiview take -o all.mkv -q").exit_code, 0);
  const std::string before = text("all.mkv");
  const auto again = exported("multiview take -o all.mkv -q --cameras c0");
  EXPECT_EQ(again.exit_code, 2);
  EXPECT_THAT(again.output, AllOf(HasSubstr("the file exists"), HasSubstr("--existing")));
  EXPECT_EQ(text("all.mkv"), before);
  EXPECT_EQ(exported("multiview take -o all.mkv -q --cameras c0 --existing overwrite").exit_code,
            0);
  EXPECT_NE(text("all.mkv"), before);
  for (const std::string command : {"movies", "images", "model"}) {
    const auto onto = exported(command + " take -o take -q");
    EXPECT_EQ(onto.exit_code, 2) << command;
    EXPECT_EQ(exported(command + " take -o take/new -q").exit_code, 2) << command;
    EXPECT_FALSE(exists("take/new"));
  }
  EXPECT_EQ(exported("mosaic take -o take/all.mp4 -q").exit_code, 2);
  EXPECT_THAT(data.names(), ElementsAre("all.mkv", "take"));
}

TEST_F(ExportTakes, WhatIsWrongIsNamedWithItsOption) {
  const auto expect_usage_error = [&](const std::string& arguments, const std::string& part) {
    const auto result = exported(arguments);
    EXPECT_EQ(result.exit_code, 2) << arguments;
    EXPECT_THAT(result.output, HasSubstr(part)) << arguments;
  };
  expect_usage_error("movies take -o m --cameras c9", "(--cameras)");
  expect_usage_error("movies take -o m --times constant --absent error", "(--absent)");
  expect_usage_error("movies take -o m --codec h264", "(--times)");
  expect_usage_error("movies take -o m --codec prores --container mkv", "Use .mov");
  expect_usage_error("movies take -o m --fps 25", "--times constant");
  expect_usage_error("movies take -o m --absent black", "--times constant");
  expect_usage_error("movies take -o m --times constant --origin first", "--origin");
  expect_usage_error("movies take -o m --from 100", "--from");
  expect_usage_error("movies take -o m --frames x", "x");
  expect_usage_error("movies take -o m --codec av1", "--codec");
  expect_usage_error("movies none -o m", "none");
  expect_usage_error("mosaic take -o m.webm", "Use .mp4");
  expect_usage_error("mosaic take -o m.mp4 --codec copy", "--codec");
  expect_usage_error("quilt take -o q.gif", "allowed: .png for pictures, .mp4");
  expect_usage_error("multiview take -o m.mov", ".mkv");
  expect_usage_error("model take -o m --format google", "--format");
  EXPECT_THAT(data.names(), ElementsAre("take"));
}

TEST_F(ExportTakes, RottenFramesHaveAnExitCode) {
  data.rot(1, 2);
  const auto result = exported("images take -o i -q");
  EXPECT_EQ(result.exit_code, 4);
  EXPECT_THAT(result.output, AllOf(HasSubstr("1 stored frames are not as they were recorded"),
                                   HasSubstr("i: 3 cameras, 20 frames")));
  EXPECT_FALSE(exists("i/c1/000003.jpg"));
  EXPECT_EQ(exported("mosaic take -o all.mp4 --tile-width 32 -q").exit_code, 4);
  EXPECT_EQ(exported("multiview take -o all.mkv -q").exit_code, 4);
}

TEST_F(ExportTakes, DamagedFramesAreNamedByTheFinalPath) {
  // A frame that is stored as it was recorded, but no JPEG.
  testing::write_take(data.out("fake"), {{0, 1'000'000}}, 20);
  const auto result = exported("images fake -o i --format png --times recorded -q");
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_THAT(result.output, AllOf(HasSubstr("c0"), Not(HasSubstr(".tmp"))));
  EXPECT_THAT(data.names(), ElementsAre("fake", "take"));
}

TEST_F(ExportTakes, AFullDiskLeavesNothing) {
  const std::string limit = "ulimit -f 4; trap '' XFSZ; ";  // blocks of 512 or 1024 bytes
  for (const std::string arguments :
       {"movies take -o m --codec ffv1", "multiview take -o m.mkv", "images take -o m --format exr",
        "mosaic take -o m.mp4 --tile-width 1024"}) {
    const std::string command = "cd '" + data.folder.path().string() + "' && " + limit + "'" +
                                testing::commands_folder().string() + "/raystage' export " +
                                arguments + " -q > /dev/null 2>&1";
    const int status = std::system(("bash -c \"" + command + "\"").c_str());
    EXPECT_EQ(WEXITSTATUS(status), 1) << arguments;
    EXPECT_THAT(data.names(), ElementsAre("take")) << arguments;
  }
}

TEST_F(ExportTakes, AKilledProcessLeavesNoFileUnderTheName) {
  for (const int signal : {SIGTERM, SIGKILL}) {
    testing::RunningCommand command({"raystage-export", "mosaic", data.path().string(), "-o",
                                     data.out("all.mkv").string(), "--fps", "1000", "--tile-width",
                                     "2048", "--codec", "ffv1"});
    // Until the temporary file is there.
    while (data.names().size() < 2) std::this_thread::sleep_for(std::chrono::milliseconds(1));
    const int status = command.end_by(signal);
    EXPECT_FALSE(exists("all.mkv"));
    if (signal == SIGTERM) {
      EXPECT_EQ(WEXITSTATUS(status), 128 + SIGTERM);
      EXPECT_THAT(data.names(), ElementsAre("take"));
    }
  }
}

}  // namespace
}  // namespace raystage::cli::export_takes_test
