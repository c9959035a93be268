// SPDX-License-Identifier: Apache-2.0
// Tests that errors of a shot are reported before its first frame is rendered.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <nlohmann/json.hpp>

#include "testing/test_folder.h"
#include "tests/end_to_end/run_command.h"

namespace raystage {
namespace {

using nlohmann::json;
using ::testing::AllOf;
using testing::CommandResult;
using ::testing::HasSubstr;
using testing::run;

class BadShot : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = std::make_unique<testing::TestFolder>();
    const CommandResult made = here(
        "raystage simulate chart -q --rows 2 --columns 2 --width 48 --height 36 --seconds 1 "
        "--startup-loss-seconds 0 --drop 0 --truth-views 0 -o take && raystage sync -q take");
    ASSERT_EQ(made.exit_code, 0) << made.err;
    std::ofstream(folder_->path() / "sign.obj") << "v -1 -1 0\nv 1 -1 0\nv 1 1 0\nf 1 2 3\n";
  }
  static void TearDownTestSuite() { folder_.reset(); }

  static CommandResult here(const std::string& command) {
    return run("cd '" + folder_->path().string() + "' && " + command);
  }
  static json good() {
    const json key = {{"frame", 1},
                      {"position", {0, 0, 0}},
                      {"orientation", {1, 0, 0, 0}},
                      {"horizontal_fov_deg", 40}};
    const json mesh = {{"file", "sign.obj"}, {"keys", {{{"frame", 1}, {"position", {0, 0, -2}}}}}};
    return {{"schema", "raystage/shot/2"},
            {"width", 32},
            {"height", 24},
            {"fps", 15},
            {"first_frame", 1},
            {"last_frame", 3},
            {"camera", {{"keys", {key}}}},
            {"layers", {{{"name", "set"}, {"take", "take"}}, {{"geometry", mesh}}}}};
  }
  /// Runs `raystage render` with the text as its shot; if it fails, expects that no frame exists.
  static CommandResult rendered(const std::string& text, const std::string& options = "") {
    std::ofstream(folder_->path() / "shot.json") << text;
    const CommandResult result =
        here("rm -rf out && raystage render -q shot.json " + options + " -o out/f.####.exr");
    if (result.exit_code != 0) {
      EXPECT_FALSE(std::filesystem::exists(folder_->path() / "out/f.0001.exr"));
    }
    return result;
  }
  static void expect_refused(const json& shot, const std::string& place, const std::string& what) {
    const CommandResult result = rendered(shot.dump());
    EXPECT_EQ(result.exit_code, 2) << place << result.err;
    EXPECT_THAT(result.err, AllOf(HasSubstr(place), HasSubstr(what)));
  }

  static std::unique_ptr<testing::TestFolder> folder_;
};

std::unique_ptr<testing::TestFolder> BadShot::folder_;

TEST_F(BadShot, TheShotItselfIsGood) {
  const CommandResult result = rendered(good().dump());
  EXPECT_EQ(result.exit_code, 0) << result.err;
  EXPECT_TRUE(std::filesystem::exists(folder_->path() / "out/f.0003.exr"));
}

TEST_F(BadShot, FilesThatAreMissing) {
  json shot = good();
  shot["layers"][0]["take"] = "gone";
  expect_refused(shot, "gone", "");
  shot = good();
  shot["layers"][1]["geometry"]["file"] = "gone.obj";
  expect_refused(shot, "gone.obj", "");
  shot = good();
  shot["layers"][1]["geometry"]["material"] = {{"kind", "diffuse"}, {"texture", "gone.png"}};
  expect_refused(shot, "gone.png", "");
  shot = good();
  shot["layers"].push_back({{"plate", {{"file", "gone.####.exr"}}}});
  expect_refused(shot, "gone.0001.exr", "");
  shot = good();
  shot["lights"] = {{{"environment", "gone.exr"}}};
  expect_refused(shot, "gone.exr", "");
}

TEST_F(BadShot, WordsThatNothingIsCalled) {
  json shot = good();
  shot["layers"][1]["geometry"]["colour"] = 1;
  expect_refused(shot, "shot.json#/layers/1/geometry", "colour");
  shot = good();
  shot["layers"][0]["method"] = "magic";
  expect_refused(shot, "magic", "focal_plane");
  shot = good();
  shot["lights"] = {{{"light_field", "nobody"}}};
  expect_refused(shot, "#/lights/0", "nobody");
}

/// The only possible cyclic dependency of layers.
TEST_F(BadShot, PlatesThatTheRenderItselfWrites) {
  std::ofstream(folder_->path() / "shot.json") << good().dump();
  ASSERT_EQ(here("rm -rf round && raystage render -q shot.json -o round/f.####.exr").exit_code, 0);
  json shot = good();
  shot["layers"].push_back({{"plate", {{"file", "round/f.####.exr"}}}});
  std::ofstream(folder_->path() / "round.json") << shot.dump();
  const CommandResult result = here(
      "raystage render -q round.json --existing overwrite -o ../$(basename $PWD)/round/f.%04d.exr");
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_THAT(result.err, AllOf(HasSubstr("round.json#/layers/2/plate"), HasSubstr("frame 1 shows"),
                                HasSubstr("which this sequence would overwrite")));
  EXPECT_EQ(here("raystage render -q round.json -o elsewhere/f.####.exr").exit_code, 0);
}

TEST_F(BadShot, NumbersThatAreNone) {
  const std::string text = good().dump();
  for (const char* number : {"NaN", "1e999", "-Infinity"}) {
    for (const char* place : {"[0,0,-2]", "[0,0,0]"}) {  // position of the mesh, of the camera
      std::string damaged = text;
      const std::size_t at = damaged.find(place);
      ASSERT_NE(at, std::string::npos);
      damaged.replace(at + 1, 1, number);
      const CommandResult result = rendered(damaged);
      EXPECT_EQ(result.exit_code, 2) << number << result.err;
      EXPECT_THAT(result.err, HasSubstr("shot.json:1:"));
    }
  }
}

TEST_F(BadShot, FramesForWhichTheTakeHasNothing) {
  json shot = good();
  shot["layers"][0]["start_seconds"] = 0.9;  // the take ends in the second frame
  shot["last_frame"] = 9;
  expect_refused(shot, "#/layers/0", "held or black (--missing)");
  for (const char* policy : {"hold", "black"}) {
    const CommandResult result = rendered(shot.dump(), std::string("--missing ") + policy);
    EXPECT_EQ(result.exit_code, 0) << result.err;
    EXPECT_TRUE(std::filesystem::exists(folder_->path() / "out/f.0009.exr"));
  }
}

}  // namespace
}  // namespace raystage
