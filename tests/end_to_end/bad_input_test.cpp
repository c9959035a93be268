// SPDX-License-Identifier: Apache-2.0
// Tests that bad input gives a clear error and exit code 2 or 1, loses nothing and leaves no
// incomplete file.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "testing/test_folder.h"
#include "tests/end_to_end/run_command.h"
#include "tests/end_to_end/small_manifest.h"

namespace raystage {
namespace {

using testing::CommandResult;
using ::testing::HasSubstr;
using testing::read_text;
using testing::replaced;
using testing::run;
using testing::small_manifest;
using testing::write_text;

/// A folder with three pictures and a valid manifest of three cameras.
class BadInput : public ::testing::Test {
 protected:
  BadInput() { testing::write_small_manifest(folder_.path()); }

  std::string path(const std::string& name) const { return (folder_.path() / name).string(); }

  CommandResult import_manifest(const std::string& text) const {
    write_text(path("import.json"), text);
    return run("raystage import '" + path("import.json") + "' -o '" + path("take") + "'");
  }
  /// Expects that the import fails as bad input, its error contains `why`, and no file is left.
  void expect_refused(const std::string& text, const std::string& why) const {
    const CommandResult result = import_manifest(text);
    EXPECT_EQ(result.exit_code, 2) << result.err;
    EXPECT_THAT(result.err, HasSubstr(why));
    EXPECT_TRUE(testing::find_files(folder_.path(), "take").empty());
  }

  testing::TestFolder folder_;
};

TEST_F(BadInput, TheManifestItselfIsGood) {
  const CommandResult result = import_manifest(small_manifest());
  EXPECT_EQ(result.exit_code, 0) << result.err;
  EXPECT_TRUE(std::filesystem::exists(path("take/archive/a.mkv")));
}

TEST_F(BadInput, MissingFiles) {
  EXPECT_EQ(run("raystage import '" + path("none.json") + "' -o '" + path("take") + "'").exit_code,
            2);
  EXPECT_EQ(run("raystage info '" + path("no-take") + "'").exit_code, 2);
  EXPECT_EQ(run("raystage sync '" + path("no-take") + "'").exit_code, 2);
  EXPECT_EQ(run("raystage render '" + path("no-shot.json") + "'").exit_code, 2);
  EXPECT_EQ(run("raystage evaluate '" + path("no-take") + "' '" + path("v.json") + "'").exit_code,
            2);
  std::filesystem::remove(path("b.jpg"));
  expect_refused(small_manifest(), "b.jpg");
}

TEST_F(BadInput, ATruncatedJpeg) {
  const std::string whole = read_text(path("b.jpg"));
  write_text(path("b.jpg"), whole.substr(0, whole.size() / 2));
  expect_refused(small_manifest(), "b.jpg");
}

TEST_F(BadInput, ACameraBehindItsOwnPlane) {
  // Camera b looks along +z, as in a manifest with OpenCV's axes.
  const std::string turned =
      replaced(small_manifest(), "[[1,0,0,0.060000],[0,1,0,0],[0,0,1,0],[0,0,0,1]]",
               "[[1,0,0,0.06],[0,-1,0,0],[0,0,-1,0],[0,0,0,1]]");
  ASSERT_NE(turned, small_manifest());
  expect_refused(turned, "#/cameras/1");
}

TEST_F(BadInput, NumbersThatAreNotFinite) {
  expect_refused(replaced(small_manifest(), "\"fx\": 30", "\"fx\": NaN"), "import.json");
  expect_refused(replaced(small_manifest(), "\"fx\": 30", "\"fx\": 1e999"), "import.json");
  expect_refused(replaced(small_manifest(), "\"nominal_fps\": 15", "\"nominal_fps\": 0"),
                 "#/nominal_fps");
}

TEST_F(BadInput, DuplicateIds) {
  expect_refused(replaced(small_manifest(), "\"id\": \"b\"", "\"id\": \"a\""), "#/cameras/1/id");
}

TEST_F(BadInput, ZeroCameras) {
  const std::string text = small_manifest();
  expect_refused(text.substr(0, text.find("\"cameras\"")) + "\"cameras\": []}", "#/cameras");
}

TEST_F(BadInput, AFutureVersion) {
  expect_refused(replaced(small_manifest(), "import/1", "import/3"), "3");
}

TEST_F(BadInput, OptionsThatAreNotFinite) {
  ASSERT_EQ(import_manifest(small_manifest()).exit_code, 0);
  const std::string evaluate = "raystage evaluate --exclude-cameras b '" + path("take") + "' ";
  EXPECT_EQ(run(evaluate + "--focal-depth 2").exit_code, 0);
  EXPECT_EQ(run(evaluate + "--focal-depth nan").exit_code, 2);
  EXPECT_EQ(run(evaluate + "--focal-depth 2 --memory nan").exit_code, 2);
  EXPECT_EQ(run(evaluate + "--focal-depth 2 --memory 1e30").exit_code, 2);
  EXPECT_EQ(run(evaluate + "--focal-depth 2 --threads -5").exit_code, 2);
  EXPECT_EQ(run("raystage render x.json --memory nan").exit_code, 2);
  EXPECT_EQ(run("raystage sync '" + path("take") + "' --fps nan").exit_code, 2);
}

TEST_F(BadInput, AnOutputFolderThatIsAFile) {
  write_text(path("file"), "no folder");
  const CommandResult result =
      run("raystage import '" + path("import.json") + "' -o '" + path("file/take") + "'");
  EXPECT_EQ(result.exit_code, 1) << result.err;
  EXPECT_THAT(result.err, HasSubstr("file"));
  EXPECT_EQ(read_text(path("file")), "no folder");
}

TEST_F(BadInput, AnOutputThatIsThereAlreadyIsKept) {
  ASSERT_EQ(import_manifest(small_manifest()).exit_code, 0);
  const std::string before = read_text(path("take/rig.json"));
  const CommandResult again = import_manifest(small_manifest());
  EXPECT_EQ(again.exit_code, 2) << again.err;
  EXPECT_EQ(read_text(path("take/rig.json")), before);
}

TEST_F(BadInput, ATakeOfOneInstantNeedsNoSync) {
  ASSERT_EQ(import_manifest(small_manifest()).exit_code, 0);
  write_text(path("shot.json"), R"({"schema": "raystage/shot/3", "name": "s", "width": 32,
    "height": 24, "fps": 24, "first_frame": 1, "last_frame": 2, "camera": {"keys": [{"frame": 1,
    "position": [0.03, 0, 0.01], "horizontal_fov_deg": 40}]},
    "layers": [{"name": "lf", "take": "take", "method": "focal_plane",
    "focal_plane": {"depth_m": 2}}]})");
  const CommandResult rendered =
      run("raystage render '" + path("shot.json") + "' -o '" + path("f.####.exr") + "'");
  EXPECT_EQ(rendered.exit_code, 0) << rendered.err;
  EXPECT_THAT(rendered.err, HasSubstr("the take has no timeline"));
  EXPECT_EQ(testing::find_files(folder_.path(), ".exr").size(), 2U);
}

TEST_F(BadInput, ATakeThatWasNeverSynchronisedSaysHowTo) {
  ASSERT_EQ(run("raystage simulate still -q --rows 1 --columns 2 --width 32 --height 24 --fps 10 "
                "--seconds 1 --truth-views 0 -o '" +
                path("take") + "'")
                .exit_code,
            0);
  write_text(path("shot.json"), R"({"schema": "raystage/shot/1", "name": "s", "width": 32,
    "height": 24, "fps": 24, "first_frame": 1, "last_frame": 2, "camera": [{"frame": 1,
    "position": [0.03, 0, 0.01], "orientation": [1, 0, 0, 0], "horizontal_fov_deg": 40}],
    "layers": [{"name": "lf", "take": "take", "method": "focal_plane",
    "focal_plane": {"depth_m": 2}}]})");
  const std::string render =
      "raystage render '" + path("shot.json") + "' -o '" + path("f.####.exr") + "'";
  const CommandResult unsynchronised = run(render);
  EXPECT_EQ(unsynchronised.exit_code, 2) << unsynchronised.err;
  EXPECT_THAT(unsynchronised.err, HasSubstr("raystage sync"));
  ASSERT_EQ(run("raystage sync '" + path("take") + "'").exit_code, 0);
  const CommandResult unknown =
      run(replaced(render, "raystage render", "raystage render --frames 1:4"));
  EXPECT_EQ(unknown.exit_code, 2);
  EXPECT_TRUE(testing::find_files(folder_.path(), ".exr").empty());
}

TEST(Usage, UnknownCommandsAndOptionsAreBadUsage) {
  EXPECT_EQ(run("raystage").exit_code, 2);
  EXPECT_EQ(run("raystage fly").exit_code, 2);
  const CommandResult version = run("raystage --version");
  EXPECT_EQ(version.exit_code, 0);
  EXPECT_THAT(version.out, ::testing::MatchesRegex(
                               "raystage [0-9.]+\nkernels: [a-z0-9_]+ \\(compiled: [a-z0-9_ ]+\\)\n"
                               "libraries: FFmpeg [^\n]+\ncompiler: [^\n]+\n"));
  for (const char* command :
       {"record", "join", "import", "simulate", "sync", "info", "verify", "repair", "render",
        "prepare", "farm", "camera", "evaluate", "bench", "preview", "plan", "export"}) {
    SCOPED_TRACE(command);
    EXPECT_EQ(run(std::string("raystage ") + command + " --no-such-option").exit_code, 2);
    EXPECT_EQ(run(std::string("raystage ") + command).exit_code, 2);
    const CommandResult help = run(std::string("raystage ") + command + " --help");
    EXPECT_EQ(help.exit_code, 0);
    EXPECT_THAT(help.out, HasSubstr("--help"));
    EXPECT_THAT(help.out, HasSubstr("--version"));
    // For farm, its sub-commands have the option.
    const std::string name = command;
    const bool has_no_progress =
        name == "info" || name == "camera" || name == "farm" || name == "plan" || name == "export";
    EXPECT_EQ(help.out.find("-q,--quiet") == std::string::npos, has_no_progress);
    EXPECT_THAT(run("raystage --help").out, HasSubstr(command));
    EXPECT_EQ(run(std::string("raystage ") + command + " --version").out, version.out);
  }
}

TEST(Usage, AnArrayIsPlanned) {
  const testing::TestFolder folder;
  const std::string take = (folder.path() / "take").string();
  ASSERT_EQ(
      run("raystage simulate -q still --rows 2 --columns 3 --width 64 --height 48 --seconds 1 "
          "--truth-views 0 -o " +
          take)
          .exit_code,
      0);
  const CommandResult planned =
      run("cd '" + folder.path().string() + "' && raystage plan resolution take --report r.html");
  EXPECT_EQ(planned.exit_code, 0) << planned.err;
  EXPECT_THAT(planned.out, HasSubstr("6 cameras, 64 pixels"));
  EXPECT_THAT(testing::read_text(folder.path() / "r.html"), HasSubstr("<svg"));
  EXPECT_EQ(run("raystage plan resolution --json " + take + "/rig.json").exit_code, 0);
  EXPECT_EQ(run("raystage plan resolution " + take + "/take.json").exit_code, 2);
}

TEST(Usage, NumbersOutOfRangeAreNamed) {
  for (const char* command :
       {"import x -o y --restart-markers=0", "import x -o y --restart-markers=65536",
        "import x -o y --restart-markers=many", "simulate -o y --seed -1", "render x --memory 1e30",
        "render x --threads -1", "sync x --fps 0", "evaluate x y --memory nan"}) {
    SCOPED_TRACE(command);
    const CommandResult result = run(std::string("raystage ") + command);
    EXPECT_EQ(result.exit_code, 2);
    const std::string line = command;
    const std::size_t option = line.find("--");
    EXPECT_THAT(result.err,
                HasSubstr(line.substr(option, line.find_first_of(" =", option) - option)));
    EXPECT_FALSE(std::filesystem::exists("y"));
  }
}

}  // namespace
}  // namespace raystage
