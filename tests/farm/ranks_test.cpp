// SPDX-License-Identifier: Apache-2.0
// Tests rendering by MPI ranks, each with a folder that has only the archives of its own cameras.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "images/exr_reader.h"
#include "testing/test_folder.h"
#include "tests/end_to_end/run_command.h"
#include "tests/farm/frame_difference.h"

namespace raystage::testing {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using ::testing::Not;

class Ranks : public ::testing::Test {
 protected:
  static constexpr int kSide = 4;

  void SetUp() override {
    const CommandResult made = here(
        "raystage simulate stage -q --rows 4 --columns 4 --width 96 --height 72 --fps 10 "
        "--spacing-mm 60 --seconds 1.6 --truth-views 0 -o take && raystage sync -q take");
    ASSERT_EQ(made.exit_code, 0) << made.err;
  }

  /// Makes a folder per rank with the take's documents and the archives of a block of cameras.
  void split(int ranks) const {
    fs::remove_all(folder_.path() / "ranks");
    const auto take = nlohmann::json::parse(read_text(folder_.path() / "take" / "take.json"));
    const int columns = ranks >= 4 ? 2 : 1;  // of the grid of ranks
    for (int rank = 0; rank < ranks; ++rank) {
      const fs::path to = folder_.path() / "ranks" / std::to_string(rank) / "take";
      fs::create_directories(to / "archive");
      for (const char* document : {"take.json", "rig.json", "timeline.zst"}) {
        fs::copy_file(folder_.path() / "take" / document, to / document);
      }
      if (fs::exists(folder_.path() / "take" / "imported_depth")) {
        fs::copy(folder_.path() / "take" / "imported_depth", to / "imported_depth",
                 fs::copy_options::recursive);
      }
      for (int camera = 0; camera < kSide * kSide; ++camera) {
        const int column = camera % kSide, row = camera / kSide;
        if ((row * (ranks / columns) / kSide) * columns + column * columns / kSide != rank)
          continue;
        for (const char* file : {"archive", "journal"}) {
          const auto name = take["cameras"][camera][file];
          fs::copy_file(folder_.path() / "take" / name, to / name);
        }
      }
    }
  }

  void write_shot(const std::string& method, const std::string& options, int frames = 2) const {
    write_text(folder_.path() / "shot.json",
               R"({"schema": "raystage/shot/3", "width": 160, "height": 120, "fps": 10,
  "first_frame": 1, "last_frame": )" +
                   std::to_string(frames) + R"(, "camera": {"keys": [
  {"frame": 1, "position": [-0.05, 0, 0.4], "target": [0, 0, -5], "horizontal_fov_deg": 40},
  {"frame": 9, "position": [0.05, 0.02, 0.4], "target": [0, 0, -5], "horizontal_fov_deg": 40}]},
  "layers": [{"take": "take", "method": ")" +
                   method + R"(", "options": )" + options +
                   R"(, "focal_plane": {"depth_m": 5}, "start_seconds": 0.5, "time": ")" + time_ +
                   R"("}]})");
  }

  CommandResult here(const std::string& command) const {
    return run("cd '" + folder_.path().string() + "' && " + command);
  }

  /// Renders by mpirun on this host, with options that let it run as root and on a busy machine.
  CommandResult render_by(int ranks, const std::string& options) const {
    return here(
        "OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1 mpirun --oversubscribe -n " +
        std::to_string(ranks) +
        " --mca btl tcp,self --mca btl_tcp_if_include lo --mca oob_tcp_if_include lo "
        "raystage render shot.json -j 1 --take-folder \"$PWD/take=$PWD/ranks/{rank}/take\" " +
        options);
  }

  CommandResult render_locally(const std::string& options = "") const {
    return here("raystage render shot.json -j 1 -o local/f.####.exr --existing overwrite " +
                options);
  }

  FrameDifference difference(const std::string& a, const std::string& b, int frame) const {
    const auto file = [&](const std::string& folder) {
      return folder_.path() / folder / ("f.000" + std::to_string(frame) + ".exr");
    };
    const FrameDifference found = frame_difference(file(a), file(b));
    EXPECT_GT(found.brightest, 0.05F) << "nothing is seen";
    return found;
  }

  void expect_equal_to_local(const std::string& method, const std::string& options,
                             bool byte_for_byte = false) const {
    SCOPED_TRACE(method + " " + options);
    write_shot(method, options);
    const CommandResult local = render_locally();
    ASSERT_EQ(local.exit_code, 0) << local.err;
    for (const int ranks : {2, 4, 8}) {
      split(ranks);
      const CommandResult distributed =
          render_by(ranks, "-o ranked/f.####.exr --existing overwrite");
      ASSERT_EQ(distributed.exit_code, 0) << distributed.err;
      for (const int frame : {1, 2}) {
        const FrameDifference found = difference("local", "ranked", frame);
        EXPECT_LE(found.most, byte_for_byte ? 0 : 1) << ranks << " ranks";
        EXPECT_LE(found.share, 0.01) << ranks << " ranks";
      }
    }
  }

  testing::TestFolder folder_;
  std::string time_ = "tick";
};

TEST_F(Ranks, RenderTheViewsOfFocalPlanesAsOneProcessDoes) {
  expect_equal_to_local("focal_plane", "{}");
  expect_equal_to_local("nearest", "{}");
  expect_equal_to_local("aperture", R"({"radius": 0.08})");
}

TEST_F(Ranks, RenderTheViewsOfLumigraphsAndSlabsAsOneProcessDoes) {
  write_text(folder_.path() / "take" / "wall.obj", "v -3 -3 -4\nv 3 -3 -4\nv 0 3 -5\nf 1 2 3\n");
  expect_equal_to_local("lumigraph", "{}");
  expect_equal_to_local("slabs", "{}");
}

TEST_F(Ranks, FetchPartsOfFramesForPlaneSweep) { expect_equal_to_local("plane_sweep", "{}", true); }

TEST_F(Ranks, RenderPicturesOfMoreThan8BitsAsOneProcessDoes) {
  fs::remove_all(folder_.path() / "take");
  const CommandResult made = here(
      "raystage simulate still -q --hdr --rows 4 --columns 4 --width 96 --height 72 --fps 10 "
      "--startup-loss-seconds 0 --seconds 0.8 --truth-views 0 -o take && raystage sync -q take");
  ASSERT_EQ(made.exit_code, 0) << made.err;
  expect_equal_to_local("focal_plane", "{}");
  expect_equal_to_local("plane_sweep", "{}", true);
  EXPECT_GT(difference("local", "ranked", 1).brightest, 8) << "highlights are lost";
}

TEST_F(Ranks, FindDepthsTogether) { expect_equal_to_local("depth", R"({"near": 2, "far": 12})"); }

// The maps are farther than the scene, so that estimated depths would give other pictures.
TEST_F(Ranks, UseImportedDepthsAsOneProcessDoes) {
  write_shot("depth", "{}");
  ASSERT_EQ(here("raystage render shot.json -j 1 -o estimated/f.####.exr").exit_code, 0);
  const CommandResult imported = here(
      "raystage export depth -q take -o maps && rm -rf take/depth && raystage import -q --depth "
      "take maps --depth-unit 1.3");
  ASSERT_EQ(imported.exit_code, 0) << imported.err;
  expect_equal_to_local("depth", "{}");
  EXPECT_GT(difference("local", "estimated", 1).share, 0.2);
  // Frames of video belong to the maps of those that they were made from.
  const CommandResult video =
      here("raystage pack -q --temporal hevc take -o video && rm -r take && mv video take");
  ASSERT_EQ(video.exit_code, 0) << video.err;
  expect_equal_to_local("depth", "{}");
}

// Each rank interpolates the pictures of its own cameras; for plane sweep, those that it fetched.
TEST_F(Ranks, RenderExactTimesAsOneProcessDoes) {
  time_ = "exact";
  expect_equal_to_local("focal_plane", "{}");
  expect_equal_to_local("plane_sweep", "{}", true);
  expect_equal_to_local("depth", R"({"near": 2, "far": 12})");
  write_shot("focal_plane", "{}");
  ASSERT_EQ(render_locally().exit_code, 0);
  time_ = "tick";
  write_shot("focal_plane", "{}");
  ASSERT_EQ(here("raystage render shot.json -j 1 -o tick/f.####.exr").exit_code, 0);
  EXPECT_GT(difference("local", "tick", 1).share, 0.01) << "the cameras run freely";
}

// Ranks move the rows of rolling shutters alike, whoever decodes and interpolates them.
TEST_F(Ranks, RenderRollingShuttersAsOneProcessDoes) {
  fs::remove_all(folder_.path() / "take");
  const CommandResult made = here(
      "raystage simulate stage -q --rows 4 --columns 4 --width 96 --height 72 --fps 10 "
      "--line-time-us 600 --spacing-mm 60 --seconds 1.6 --truth-views 0 -o take && "
      "raystage sync -q take");
  ASSERT_EQ(made.exit_code, 0) << made.err;
  expect_equal_to_local("focal_plane", "{}");
  const CommandResult ticks = render_locally();
  EXPECT_THAT(ticks.err, HasSubstr("rolling shutters: each row shows the time"));
  fs::copy(folder_.path() / "local", folder_.path() / "ticks");
  time_ = "exact";
  expect_equal_to_local("focal_plane", "{}");
  expect_equal_to_local("plane_sweep", "{}", true);
  write_shot("focal_plane", "{}");
  EXPECT_THAT(render_locally().err, Not(HasSubstr("rolling shutters")));
  EXPECT_GT(difference("local", "ticks", 1).share, 0.01) << "rows are moved";
}

TEST_F(Ranks, SayWhatCrossedBetweenThem) {
  write_shot("focal_plane", "{}");
  split(4);
  const CommandResult rendered = render_by(4, "-o ranked/f.####.exr");
  EXPECT_THAT(rendered.err, HasSubstr("the first of 4 ranks"));
  EXPECT_THAT(rendered.err, HasSubstr("samples per view pixel"));
}

TEST_F(Ranks, SendFewerBytesWithLossySamples) {
  write_shot("focal_plane", "{}");
  split(4);
  ASSERT_EQ(render_locally().exit_code, 0);
  ASSERT_EQ(render_by(4, "-o ranked/f.####.exr --fragments half").exit_code, 0);
  const FrameDifference half = difference("local", "ranked", 1);
  EXPECT_GT(half.most, 0);
  EXPECT_LE(half.most, 3);
  ASSERT_EQ(render_by(4, "-o ranked/f.####.exr --existing overwrite --fragments jpeg").exit_code,
            0);
  const FrameDifference jpeg = difference("local", "ranked", 1);
  EXPECT_GT(jpeg.psnr_db, 36);
  EXPECT_LT(jpeg.psnr_db, 60);
  EXPECT_LE(jpeg.most_alpha, 1) << "weights do not cross";
}

TEST_F(Ranks, LeaveOutCamerasThatNoneHasOrRefuse) {
  write_shot("focal_plane", "{}");
  split(4);
  fs::remove_all(folder_.path() / "ranks" / "2" / "take");
  const CommandResult refused = render_by(4, "-o ranked/f.####.exr");
  EXPECT_EQ(refused.exit_code, 2) << refused.err;
  EXPECT_THAT(refused.err, HasSubstr("rank 2 cannot open it"));
  fs::create_directories(folder_.path() / "ranks" / "2" / "take" / "archive");
  for (const char* document : {"take.json", "rig.json", "timeline.zst"}) {
    fs::copy_file(folder_.path() / "take" / document,
                  folder_.path() / "ranks" / "2" / "take" / document);
  }
  const CommandResult without = render_by(4, "-o ranked/f.####.exr");
  EXPECT_EQ(without.exit_code, 2) << without.err;
  EXPECT_THAT(without.err, HasSubstr("no rank has the archives of 4 of 16 cameras"));
  EXPECT_FALSE(fs::exists(folder_.path() / "ranked"));
  const CommandResult absent = render_by(4, "-o ranked/f.####.exr --missing-archives absent");
  ASSERT_EQ(absent.exit_code, 0) << absent.err;
  constexpr images::ExrChannel kCoverage[] = {{"coverage.V"}};
  const images::ExrChannelData coverage =
      images::read_exr_channels(folder_.path() / "ranked" / "f.0001.exr", kCoverage, "");
  EXPECT_LT(*std::ranges::min_element(coverage.values), 0.9F);
  const CommandResult header = here("exrheader ranked/f.0001.exr");
  EXPECT_THAT(header.out, HasSubstr("absentCameras"));
}

TEST_F(Ranks, RefuseTakeFoldersThatHelpNoTake) {
  write_shot("focal_plane", "{}");
  split(2);
  const CommandResult unused =
      render_by(2, "-o ranked/f.####.exr --take-folder /nowhere/takes=/elsewhere");
  EXPECT_EQ(unused.exit_code, 2) << unused.err;
  EXPECT_THAT(unused.err, HasSubstr("no take of the shot is in the folder /nowhere/takes"));
  const CommandResult malformed = render_by(2, "-o ranked/f.####.exr --take-folder /nowhere");
  EXPECT_EQ(malformed.exit_code, 2) << malformed.err;
  EXPECT_THAT(malformed.err, HasSubstr("FROM=TO"));
  fs::remove_all(folder_.path() / "ranks" / "1");
  const CommandResult missing = render_by(2, "-o ranked/f.####.exr");
  EXPECT_EQ(missing.exit_code, 2) << missing.err;
  EXPECT_THAT(missing.err, HasSubstr("rank 1 cannot open it"));
}

TEST_F(Ranks, RefuseWhatCannotBeRenderedTogether) {
  split(2);
  for (const auto& [method, options] : std::vector<std::pair<std::string, std::string>>{
           {"auto", "{}"},
           {"lumigraph", R"({"proxy": "depth"})"},
           {"depth", R"({"near": 2, "far": 12, "temporal": true})"}}) {
    write_shot(method, options);
    const CommandResult refused = render_by(2, "-o ranked/f.####.exr");
    EXPECT_EQ(refused.exit_code, 2) << method << refused.err;
    EXPECT_THAT(refused.err, HasSubstr("cannot be rendered from archives on several hosts"));
  }
  write_shot("focal_plane", "{}");
  const CommandResult alone = render_locally("--fragments half");
  EXPECT_EQ(alone.exit_code, 2);
  EXPECT_THAT(alone.err, HasSubstr("mpirun"));
}

/// Overwrites the middle of the archives of rank 1, so that frames there lose their markers.
void damage_frames(const std::filesystem::path& take_of_rank_1) {
  for (const auto& entry : std::filesystem::directory_iterator(take_of_rank_1 / "archive")) {
    if (entry.path().extension() != ".mkv") continue;
    std::string bytes = read_text(entry.path());
    for (std::size_t i = bytes.size() / 2; i < bytes.size() * 6 / 10; ++i) bytes[i] = '\xFF';
    write_text(entry.path(), bytes);
  }
}

TEST_F(Ranks, ReportADamagedFrameOfAnotherHostAndGoOn) {
  write_shot("focal_plane", "{}", 5);
  split(2);
  damage_frames(folder_.path() / "ranks" / "1" / "take");
  const CommandResult some = render_by(2, "-o ranked/f.####.exr");
  EXPECT_EQ(some.exit_code, 3) << some.err;
  EXPECT_THAT(some.err, HasSubstr("failed:"));
}

// For lockstep views: a rank fails while the others send messages that are too long for MPI to
// buffer.
TEST_F(Ranks, GoOnWithTheNextViewWhereOneFailsInStep) {
  write_shot("depth", R"({"near": 2, "far": 12})", 5);
  split(4);
  damage_frames(folder_.path() / "ranks" / "1" / "take");
  const CommandResult some = render_by(4, "-o ranked/f.####.exr");
  EXPECT_EQ(some.exit_code, 3) << some.err;
  EXPECT_THAT(some.err, HasSubstr("failed:"));
  EXPECT_FALSE(fs::exists(folder_.path() / "ranked" / "f.0001.exr")) << some.err;
  EXPECT_TRUE(fs::exists(folder_.path() / "ranked" / "f.0005.exr")) << some.err;
}

}  // namespace
}  // namespace raystage::testing
