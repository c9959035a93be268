// SPDX-License-Identifier: Apache-2.0
// raystage prepare, and raystage render after it, as a farm runs them.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/atomic_file.h"
#include "testing/cli/test_command.h"
#include "testing/compose/sequence_test_data.h"

namespace raystage::cli {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using ::testing::MatchesRegex;
using ::testing::Not;
using ::testing::StartsWith;

struct PrepareCommand : ::testing::Test {
  PrepareCommand() {
    testing::write_wall_take(folder.path() / "take");
    shot.layers.front().method = "depth";
  }
  testing::CommandResult run(const std::string& command, const std::string& options = "") const {
    schemas::write_shot(shot, folder.path() / "shot.json");
    return testing::run_raystage(command + " '" + path("shot.json") + "' --cache '" +
                                 path("cache") + "' " + options);
  }
  std::string path(const char* name) const { return (folder.path() / name).string(); }
  int files(std::string_view start) const {
    int count = 0;
    std::error_code none;
    for (const auto& entry : fs::recursive_directory_iterator(folder.path() / "cache", none)) {
      const std::string name = entry.path().filename().string();
      count += entry.is_regular_file() && name.starts_with(start) ? 1 : 0;
    }
    return count;
  }

  testing::TestFolder folder;
  schemas::ShotDocument shot = testing::wall_shot();
};

TEST_F(PrepareCommand, StoresWhatRenderReads) {
  testing::CommandResult result = run("prepare", "--frames 101-103 --memory 0.5 -j 2 --pin job");
  EXPECT_EQ(result.exit_code, 0) << result.output;
  EXPECT_THAT(result.output, HasSubstr("\ndepths of 3 light field frames solved, of 0 read\n"));
  EXPECT_THAT(result.output, HasSubstr("Progress: 100%\n"));
  EXPECT_EQ(files("pin.job"), 1);
  result = run("prepare", "--progress openjd");
  EXPECT_EQ(result.exit_code, 0) << result.output;
  EXPECT_THAT(result.output, HasSubstr("depths of 3 light field frames solved, of 3 read\n"));
  EXPECT_THAT(result.output, HasSubstr("openjd_progress: 100\n"));
  result = run("render", "-o '" + path("out.####.exr") + "'");
  EXPECT_EQ(result.exit_code, 0) << result.output;
  EXPECT_THAT(result.output,
              HasSubstr("\ndepths of 0 light field frames solved, of 6 read\nmilliseconds"));
  EXPECT_FALSE(fs::exists(folder.path() / "take" / "depth"));
  shot.layers.front().method = "focal_plane";
  result = run("render", "--existing overwrite -o '" + path("out.####.exr") + "'");
  EXPECT_THAT(result.output, Not(HasSubstr("depths of")));
}

TEST_F(PrepareCommand, ListsAndStoresTicksThatAreNamed) {
  testing::CommandResult result = run("prepare", "--frames 101-103 --list");
  EXPECT_EQ(result.exit_code, 0) << result.output;
  EXPECT_THAT(result.output, StartsWith("0:0\tmissing\t101\t" + path("cache") + "/depth/"));
  EXPECT_EQ(std::ranges::count(result.output, '\n'), 3);
  EXPECT_EQ(files(""), 0);
  result = run("prepare", "--instants 0:4,0:1");
  EXPECT_EQ(result.exit_code, 0) << result.output;
  EXPECT_EQ(files(""), 2);
  result = run("prepare", "--list --instants 0:1,0:2");
  EXPECT_THAT(result.output, MatchesRegex("0:1\tstored\t102\t.*\n0:2\tmissing\t103\t.*\n"));
}

TEST_F(PrepareCommand, RefusesWhatIsNoInstantOrNotNeeded) {
  for (const char* wrong : {"0", "0:", ":1", "0:x", "0:1,", "0:-1", "0:1:2", "0:1 ", "x:0"}) {
    const testing::CommandResult result = run("prepare", "--instants '" + std::string(wrong) + "'");
    EXPECT_EQ(result.exit_code, 2) << wrong;
    EXPECT_THAT(result.output, HasSubstr("is not LAYER:TICK")) << wrong;
  }
  EXPECT_THAT(run("prepare", "--instants 0:6").output, HasSubstr("tick 6 of layer 0"));
  EXPECT_EQ(run("prepare", "--frames 101 --instants 0:1").exit_code, 2);
  EXPECT_EQ(run("prepare", "--frames 7").exit_code, 2);
  EXPECT_EQ(run("prepare", "--pin a/b").exit_code, 2);
  shot.last_frame = 108;
  EXPECT_EQ(run("prepare").exit_code, 2) << "the take has six ticks";
  EXPECT_EQ(files(""), 0);
  EXPECT_EQ(run("prepare", "--missing hold").exit_code, 0);
}

TEST_F(PrepareCommand, FailsWhereNothingCanBeStored) {
  write_file_atomically(path("cache"), std::string_view("no folder"));
  const testing::CommandResult result = run("prepare", "--frames 101");
  EXPECT_EQ(result.exit_code, 1) << result.output;
  EXPECT_THAT(result.output, HasSubstr("tick 0 of layer 0 failed"));
  EXPECT_EQ(run("render", "--frames 101 -o '" + path("out.####.exr") + "'").exit_code, 0);
}

}  // namespace
}  // namespace raystage::cli
