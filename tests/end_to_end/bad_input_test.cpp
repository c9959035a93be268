// SPDX-License-Identifier: Apache-2.0
// Bad input of every kind: a clear error, exit code 2 or 1, nothing lost, no half file.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "render/synthetic_take.h"
#include "tests/end_to_end/run_command.h"

namespace raystage {
namespace {

using testing::CommandResult;
using ::testing::HasSubstr;
using testing::replaced;
using testing::run;
using testing::text_of;
using testing::write_text;

/// A folder with three pictures and a manifest of three cameras that imports well.
class BadInput : public ::testing::Test {
 protected:
  BadInput() {
    const RgbImage picture{32, 24, std::vector<std::uint8_t>(32 * 24 * 3, 90)};
    const auto jpeg = encode_jpeg(picture, {});
    for (const char* name : {"a.jpg", "b.jpg", "c.jpg"}) {
      write_text(path(name), std::string(reinterpret_cast<const char*>(jpeg.data()), jpeg.size()));
    }
    write_text(path("import.json"), manifest());
  }

  static std::string camera(const std::string& id, double x) {
    return R"({"id": ")" + id + R"(", "width": 32, "height": 24,
      "intrinsics": {"fx": 30, "fy": 30, "cx": 16, "cy": 12},
      "world_from_camera": [[1,0,0,)" +
           std::to_string(x) + R"(],[0,1,0,0],[0,0,1,0],[0,0,0,1]],
      "frames": [{"file": ")" +
           id + R"(.jpg", "time_ns": 0}]})";
  }
  static std::string manifest() {
    return R"({"schema": "raystage/import/1", "name": "pair", "epoch_utc": "2026-01-01T00:00:00Z",
      "nominal_fps": 15, "color_space": "srgb_texture", "depth_range_m": [1, 4],
      "cameras": [)" +
           camera("a", 0) + "," + camera("b", 0.06) + "," + camera("c", 0.12) + "]}";
  }
  std::string path(const std::string& name) const { return (folder_.path() / name).string(); }

  CommandResult import_manifest(const std::string& text) const {
    write_text(path("import.json"), text);
    return run("raystage import '" + path("import.json") + "' -o '" + path("take") + "'");
  }
  /// The import must be refused as bad input, saying `why`, and leave nothing behind.
  void expect_refused(const std::string& text, const std::string& why) const {
    const CommandResult result = import_manifest(text);
    EXPECT_EQ(result.exit_code, 2) << result.err;
    EXPECT_THAT(result.err, HasSubstr(why));
    EXPECT_TRUE(testing::files_with(folder_.path(), "take").empty());
  }

  TestFolder folder_;
};

TEST_F(BadInput, TheManifestItselfIsGood) {
  const CommandResult result = import_manifest(manifest());
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
  expect_refused(manifest(), "b.jpg");
}

TEST_F(BadInput, ATruncatedJpeg) {
  const std::string whole = text_of(path("b.jpg"));
  write_text(path("b.jpg"), whole.substr(0, whole.size() / 2));
  expect_refused(manifest(), "b.jpg");
}

TEST_F(BadInput, ACameraBehindItsOwnPlane) {
  // Camera b looks along +z: it is the picture of a manifest in OpenCV's axes.
  const std::string turned =
      replaced(manifest(), "[[1,0,0,0.060000],[0,1,0,0],[0,0,1,0],[0,0,0,1]]",
               "[[1,0,0,0.06],[0,-1,0,0],[0,0,-1,0],[0,0,0,1]]");
  ASSERT_NE(turned, manifest());
  expect_refused(turned, "#/cameras/1");
}

TEST_F(BadInput, NumbersThatAreNotFinite) {
  expect_refused(replaced(manifest(), "\"fx\": 30", "\"fx\": NaN"), "import.json");
  expect_refused(replaced(manifest(), "\"fx\": 30", "\"fx\": 1e999"), "import.json");
  expect_refused(replaced(manifest(), "\"nominal_fps\": 15", "\"nominal_fps\": 0"),
                 "#/nominal_fps");
}

TEST_F(BadInput, DuplicateIds) {
  expect_refused(replaced(manifest(), "\"id\": \"b\"", "\"id\": \"a\""), "#/cameras/1/id");
}

TEST_F(BadInput, ZeroCameras) {
  const std::string text = manifest();
  expect_refused(text.substr(0, text.find("\"cameras\"")) + "\"cameras\": []}", "#/cameras");
}

TEST_F(BadInput, AFutureVersion) {
  expect_refused(replaced(manifest(), "import/1", "import/2"), "2");
}

TEST_F(BadInput, AFullDisk) {
  // A limit on the size of files is a full disk for whoever writes them.
  const CommandResult result =
      run("ulimit -f 1; raystage import '" + path("import.json") + "' -o '" + path("take") + "'");
  EXPECT_EQ(result.exit_code, 1) << result.err;
  EXPECT_THAT(result.err, HasSubstr("take"));
  EXPECT_TRUE(testing::files_with(folder_.path(), "take").empty());
}

TEST_F(BadInput, AFullDiskUnderPictures) {
  ASSERT_EQ(import_manifest(manifest()).exit_code, 0);
  // Its output goes nowhere: the limit holds for the test's own files too.
  const CommandResult evaluated =
      run("trap '' XFSZ; ulimit -f 0; raystage evaluate '" + path("take") +
          "' --leave-out b --focal-depth 2 --out '" + path("pictures") + "' >/dev/null 2>&1");
  EXPECT_EQ(evaluated.exit_code, 1);
  EXPECT_TRUE(testing::files_with(folder_.path() / "pictures", "png").empty());
}

TEST_F(BadInput, OptionsThatAreNotFinite) {
  ASSERT_EQ(import_manifest(manifest()).exit_code, 0);
  const std::string evaluate = "raystage evaluate --leave-out b '" + path("take") + "' ";
  EXPECT_EQ(run(evaluate + "--focal-depth 2").exit_code, 0);
  EXPECT_EQ(run(evaluate + "--focal-depth nan").exit_code, 2);
  EXPECT_EQ(run(evaluate + "--focal-depth 2 --memory nan").exit_code, 2);
  EXPECT_EQ(run(evaluate + "--focal-depth 2 --memory 1e30").exit_code, 2);
  EXPECT_EQ(run(evaluate + "--focal-depth 2 --threads -5").exit_code, 2);
  EXPECT_EQ(run("raystage render x.json --memory nan").exit_code, 2);
  EXPECT_EQ(run("raystage sync '" + path("take") + "' --fps nan").exit_code, 2);
}

TEST_F(BadInput, AnOutputFolderWithoutPermission) {
  write_text(path("file"), "no folder");
  CommandResult result =
      run("raystage import '" + path("import.json") + "' -o '" + path("file/take") + "'");
  EXPECT_EQ(result.exit_code, 1) << result.err;
  EXPECT_THAT(result.err, HasSubstr("file"));
  if (geteuid() == 0) return;  // root may write anywhere
  std::filesystem::create_directory(path("locked"));
  std::filesystem::permissions(path("locked"), std::filesystem::perms::owner_read);
  result = run("raystage import '" + path("import.json") + "' -o '" + path("locked/take") + "'");
  std::filesystem::permissions(path("locked"), std::filesystem::perms::owner_all);
  EXPECT_EQ(result.exit_code, 1) << result.err;
}

TEST_F(BadInput, AnOutputThatIsThereAlreadyIsKept) {
  ASSERT_EQ(import_manifest(manifest()).exit_code, 0);
  const std::string before = text_of(path("take/rig.json"));
  const CommandResult again = import_manifest(manifest());
  EXPECT_NE(again.exit_code, 0);
  EXPECT_EQ(text_of(path("take/rig.json")), before);
}

TEST_F(BadInput, ATakeThatWasNeverSynchronisedSaysHowTo) {
  ASSERT_EQ(import_manifest(manifest()).exit_code, 0);
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
  EXPECT_TRUE(testing::files_with(folder_.path(), ".exr").empty());
}

TEST(Usage, UnknownCommandsAndOptionsAreBadUsage) {
  EXPECT_EQ(run("raystage").exit_code, 2);
  EXPECT_EQ(run("raystage fly").exit_code, 2);
  for (const char* command :
       {"import", "simulate", "sync", "info", "render", "evaluate", "preview"}) {
    SCOPED_TRACE(command);
    EXPECT_EQ(run(std::string("raystage ") + command + " --no-such-option").exit_code, 2);
    EXPECT_EQ(run(std::string("raystage ") + command).exit_code, 2);
    const CommandResult help = run(std::string("raystage ") + command + " --help");
    EXPECT_EQ(help.exit_code, 0);
    EXPECT_THAT(help.out, HasSubstr("--help"));
    EXPECT_THAT(help.out, HasSubstr("--version"));
    EXPECT_THAT(run("raystage --help").out, HasSubstr(command));
    EXPECT_THAT(run(std::string("raystage ") + command + " --version").out, HasSubstr("raystage "));
  }
  EXPECT_EQ(run("raystage --version").exit_code, 0);
}

}  // namespace
}  // namespace raystage
