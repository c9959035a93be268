// SPDX-License-Identifier: Apache-2.0
// Tests commands that cannot write, on a full disk or without permission: exit code 1, file and
// cause on stderr, and all files unchanged.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "testing/test_folder.h"
#include "testing/test_paths.h"
#include "testing/test_permissions.h"
#include "tests/end_to_end/run_command.h"
#include "tests/end_to_end/small_manifest.h"

namespace raystage {
namespace {

using ::testing::AllOf;
using ::testing::AnyOf;
using testing::CommandResult;
using ::testing::HasSubstr;
using ::testing::Not;
using testing::read_folder;
using testing::run;
using testing::write_text;

using Contents = std::map<std::string, std::string>;

/// Returns the new, changed and removed files.
Contents changes(const Contents& before, const Contents& after) {
  Contents changed;
  for (const auto& [name, text] : after) {
    const auto old = before.find(name);
    if (old == before.end() || old->second != text) changed[name] = text;
  }
  for (const auto& [name, text] : before) {
    if (!after.contains(name)) changed[name] = "gone";
  }
  return changed;
}

/// A command to run in the test's folder, which contains `import.json`, `take`, `shot.json`,
/// `frames` and a folder `out`.
struct Writing {
  const char* name;
  const char* command;
  const char* output;           ///< file or folder that it writes
  bool there_before = true;     ///< whether it exists and is replaced
  bool same_every_time = true;  ///< false if it contains measured times
  friend void PrintTo(const Writing& writing, std::ostream* out) { *out << writing.name; }

  /// Returns the program and command, for example "raystage sync".
  std::string program() const {
    const std::string text = command;
    return text.substr(0, text.find(' ', text.find(' ') + 1));
  }
};

class Unwritable : public ::testing::TestWithParam<Writing> {
 protected:
  void SetUp() override {
    testing::write_small_manifest(folder());
    write_text(folder() / "shot.json", R"({"schema": "raystage/shot/1", "name": "s",
      "width": 64, "height": 48, "fps": 24, "first_frame": 1, "last_frame": 9, "camera": [{"frame": 1,
      "position": [0.06, 0, 0], "orientation": [1, 0, 0, 0], "horizontal_fov_deg": 40}],
      "layers": [{"name": "lf", "take": "take", "speed": 0, "method": "focal_plane",
      "focal_plane": {"depth_m": 2}}]})");
    for (const char* preparation :
         {"raystage import import.json -o take", "raystage sync take",
          "raystage render shot.json -o frames/s.####.exr --frames 1-3"}) {
      const CommandResult result = run_here(preparation);
      ASSERT_EQ(result.exit_code, 0) << preparation << "\n" << result.err;
    }
    std::filesystem::create_directory(folder() / "out");
    if (GetParam().there_before) write_text(output(), "what was there before\n");
  }

  const std::filesystem::path& folder() const { return folder_.path(); }
  std::filesystem::path output() const { return folder() / GetParam().output; }
  /// Event logs are left out: without them, commands do what they were asked for all the same.
  static std::string enter(const std::filesystem::path& folder) {
    return "cd '" + folder.string() + "' && RAYSTAGE_EVENT_LOG=0 ";
  }
  CommandResult run_here(const std::string& command,
                         const testing::CommandLimits& lacks = {}) const {
    return run(enter(folder()) + command, lacks);
  }

  /// Returns the files that the command writes in a writable copy of the folder.
  Contents written_where_it_can(const testing::CommandLimits& lacks) const {
    const testing::TestFolder elsewhere;
    std::filesystem::copy(folder(), elsewhere.path() / "all",
                          std::filesystem::copy_options::recursive);
    if (lacks.root) {
      std::filesystem::permissions(elsewhere.path(), std::filesystem::perms(0755));
      testing::make_world_writable(elsewhere.path() / "all");
    }
    const CommandResult result = run(enter(elsewhere.path() / "all") + GetParam().command, lacks);
    EXPECT_EQ(result.exit_code, 0) << result.err;
    return changes(read_folder(folder()), read_folder(elsewhere.path() / "all"));
  }

  void expect_refused(const testing::CommandLimits& lacks, const std::string& why) const {
    const auto before = read_folder(folder());
    const CommandResult result = run_here(GetParam().command, lacks);
    EXPECT_EQ(result.exit_code, 1) << result.err;
    EXPECT_THAT(result.err, HasSubstr(GetParam().program()));
    // A render may check its folder before its first frame.
    const std::string folder_of_output = output().parent_path().filename().string();
    EXPECT_THAT(result.err,
                AnyOf(AllOf(HasSubstr(output().filename().string()), HasSubstr(why)),
                      HasSubstr(folder_of_output + ": the output folder cannot be written to")));
    EXPECT_THAT(result.err, Not(HasSubstr("unexpected")));
    for (const auto& [name, text] : changes(before, read_folder(folder()))) {
      ADD_FAILURE() << name << " changed: " << text.substr(0, 100);
    }
  }

 private:
  testing::TestFolder folder_;
};

TEST_P(Unwritable, AFullDiskChangesNothing) {
  const auto written = written_where_it_can({});
  ASSERT_FALSE(written.empty());
  std::size_t largest = 0;
  for (const auto& [name, text] : written) largest = std::max(largest, text.size());
  // Full from the start, early in the first file, or late in the largest.
  const std::size_t late = GetParam().same_every_time ? largest - 1 : largest / 2;
  for (const std::size_t room : {std::size_t{0}, std::size_t{20}, late}) {
    SCOPED_TRACE(std::to_string(room) + " bytes");
    expect_refused({.max_file_bytes = room}, "File too large");
  }
}

TEST_P(Unwritable, AFolderWithoutPermissionChangesNothing) {
  testing::make_world_writable(folder());
  for (const std::string& path :
       {folder().string(), (testing::commands_folder() / "raystage").string()}) {
    const std::string closed = testing::unprivileged_access_error(path);
    if (!closed.empty()) GTEST_SKIP() << closed;
  }
  EXPECT_FALSE(
      written_where_it_can({.root = true}).empty());  // so only the lock can cause a failure
  const testing::ReadOnlyFolder locked(output().parent_path());
  expect_refused({.root = true}, "ermission denied");
}

INSTANTIATE_TEST_SUITE_P(
    Commands, Unwritable,
    ::testing::Values(
        Writing{"import", "raystage import import.json -o out/new", "out/new", false},
        Writing{"simulate",
                "raystage simulate -o out/new --rows 1 --columns 2 --width 32 --height 24 "
                "--seconds 1 --truth-views 1 --truth-samples 1",
                "out/new", false},
        Writing{"import_rig", "raystage import import.json --rig-only -o out/rig.json",
                "out/rig.json", false},
        Writing{"export_rig", "raystage export rig take --format nerf -o out/t.json", "out/t.json"},
        Writing{"sync", "raystage sync take", "take/timeline.zst"},
        Writing{"render",
                "raystage render shot.json -o out/s.####.exr --frames 1 --existing overwrite",
                "out/s.0001.exr"},
        Writing{"evaluate_out",
                "raystage evaluate take --exclude-cameras b --focal-depth 2 --out out",
                "out/b.png"},
        Writing{"evaluate_json",
                "raystage evaluate take --exclude-cameras b --focal-depth 2 --json out/e.json",
                "out/e.json", true, false},
        Writing{"evaluate_table",
                "raystage evaluate take --exclude-cameras b --focal-depth 2 --table out/t.md",
                "out/t.md", true, false},
        Writing{"preview_movie", "raystage preview 'frames/s.####.exr' -o out/p.mp4", "out/p.mp4"},
        Writing{"preview_mkv", "raystage preview 'frames/s.####.exr' -o out/p.mkv", "out/p.mkv"},
        Writing{"preview_contact_sheet",
                "raystage preview 'frames/s.####.exr' --contact-sheet out/c.png", "out/c.png"}),
    [](const auto& test) { return std::string(test.param.name); });

}  // namespace
}  // namespace raystage
