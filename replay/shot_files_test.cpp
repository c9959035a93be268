// SPDX-License-Identifier: Apache-2.0
#include "replay/shot_files.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/atomic_file.h"
#include "base/error.h"
#include "testing/test_folder.h"

namespace raystage::replay {
namespace {

using ::testing::HasSubstr;

constexpr const char* kShot = R"({
  "schema": "raystage/shot/2",
  "comment": "stays",
  "name": "test",
  "width": 64, "height": 48, "fps": 24, "first_frame": 1, "last_frame": 2,
  "camera": {"keys": [{"frame": 1, "position": [0, 0, 0], "horizontal_fov_deg": 40, "x_mine": 1}]},
  "layers": [{"name": "a", "solid": {"color": [1, 0, 0]}}]
}
)";

class ShotFilesTest : public ::testing::Test {
 protected:
  void SetUp() override { create_folder(folder()); }
  std::filesystem::path folder() const { return outside_.path() / "shots"; }

  std::string error_of(const std::function<void()>& action) const {
    try {
      action();
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  }

  testing::TestFolder outside_;
};

TEST_F(ShotFilesTest, KeepTheTextAsItIs) {
  const ShotFiles files(folder());
  files.write("a.json", kShot, false);
  EXPECT_EQ(files.read("a.json"), kShot);
  EXPECT_EQ(read_file(folder() / "a.json"), kShot);
}

TEST_F(ShotFilesTest, ReplaceOnlyShotsAndOnlyIfAsked) {
  const ShotFiles files(folder());
  files.write("a.json", kShot, false);
  EXPECT_THAT(error_of([&] { files.write("a.json", kShot, false); }), HasSubstr("exists"));
  files.write("a.json", kShot, true);
  write_file_atomically(folder() / "take.json",
                        std::string_view("{\"schema\": \"raystage/take/1\"}"));
  EXPECT_NE(error_of([&] { files.write("take.json", kShot, true); }), "");
  EXPECT_THAT(read_file(folder() / "take.json"), HasSubstr("take/1"));
}

TEST_F(ShotFilesTest, AreValidShots) {
  const ShotFiles files(folder());
  EXPECT_NE(error_of([&] { files.write("a.json", "{}", false); }), "");
  EXPECT_THAT(error_of([&] { files.write("a.sh", kShot, false); }), HasSubstr(".json"));
  EXPECT_FALSE(file_exists(folder() / "a.json"));
}

TEST_F(ShotFilesTest, AreNeverOutsideOfTheFolder) {
  write_file_atomically(outside_.path() / "secret.json", std::string_view(kShot));
  std::filesystem::create_symlink(outside_.path() / "secret.json", folder() / "link.json");
  std::filesystem::create_directory_symlink(outside_.path(), folder() / "up");
  const ShotFiles files(folder());
  for (const std::string& file :
       {std::string("../secret.json"), (outside_.path() / "secret.json").string(),
        std::string("link.json"), std::string("up/secret.json"), std::string("up/new.json"),
        std::string("a/../../secret.json"), std::string(), std::string("."), std::string("..")}) {
    EXPECT_THAT(error_of([&] { files.read(file); }), HasSubstr("outside")) << file;
    EXPECT_THAT(error_of([&] { files.write(file, kShot, true); }), HasSubstr("outside")) << file;
  }
  EXPECT_EQ(read_file(outside_.path() / "secret.json"), kShot);
  EXPECT_FALSE(file_exists(outside_.path() / "new.json"));
}

TEST_F(ShotFilesTest, AreNotFoldersAndNotHuge) {
  const ShotFiles files(folder());
  create_folder(folder() / "b.json");
  EXPECT_NE(error_of([&] { files.read("b.json"); }), "");
  EXPECT_NE(error_of([&] { files.read("missing.json"); }), "");
  write_file_atomically(folder() / "c.json", std::string(5'000'000, ' '));
  EXPECT_THAT(error_of([&] { files.read("c.json"); }), HasSubstr("4 MB"));
}

TEST_F(ShotFilesTest, NeverWriteIntoATake) {
  create_folder(folder() / "take");
  write_file_atomically(folder() / "take/take.json", std::string_view("{}"));
  create_folder(folder() / "take/more");
  const ShotFiles files(folder());
  for (const char* file : {"take/", "take/.", "take"}) {
    EXPECT_NE(error_of([&] { files.write_autosave(file, kShot); }), "") << file;
    EXPECT_NE(error_of([&] { files.forget_autosave(file); }), "") << file;
  }
  for (const char* file : {"take/a.json", "take/more/a.json"}) {
    EXPECT_THAT(error_of([&] { files.write(file, kShot, true); }), HasSubstr("inside of a take"));
    EXPECT_THAT(error_of([&] { files.write_autosave(file, kShot); }),
                HasSubstr("inside of a take"));
  }
  EXPECT_FALSE(file_exists(folder() / "take/a.json"));
  // A folder with a file of this name would be taken for a take.
  EXPECT_THAT(error_of([&] { files.write("take.json", kShot, false); }), HasSubstr("not called"));
}

TEST_F(ShotFilesTest, ChangePathsForAnotherFolder) {
  const ShotFiles files(folder());
  create_folder(folder() / "shots");
  std::string shot(kShot);
  const std::string_view solid = R"("solid": {"color": [1, 0, 0]})";
  ASSERT_NE(shot.find(solid), std::string::npos);
  shot.replace(shot.find(solid), solid.size(), R"("take": "take")");
  const std::string written = files.write("shots/a.json", shot, false, "b.json");
  EXPECT_EQ(files.read("shots/a.json"), written);
  EXPECT_THAT(written, HasSubstr(R"("take": "../take")"));
  EXPECT_EQ(files.write("c.json", kShot, false, "b.json"), kShot) << "the same folder";
}

TEST_F(ShotFilesTest, KeepUnsavedWorkUntilItIsForgotten) {
  const ShotFiles files(folder());
  EXPECT_EQ(files.read_autosave("a.json"), "");
  files.write_autosave("a.json", kShot);
  EXPECT_EQ(files.read_autosave("a.json"), kShot);
  files.write("a.json", kShot, false);
  files.forget_autosave("a.json");
  EXPECT_EQ(files.read_autosave("a.json"), "");
  EXPECT_NE(error_of([&] { files.write_autosave("a.json", "{}"); }), "");
  // The file is newer: somebody saved the shot by other means.
  files.write_autosave("a.json", kShot);
  std::filesystem::last_write_time(
      folder() / "a.autosave.json",
      std::filesystem::file_time_type::clock::now() - std::chrono::hours(1));
  EXPECT_EQ(files.read_autosave("a.json"), "");
}

TEST_F(ShotFilesTest, KeepNotesBesideTheShot) {
  const ShotFiles files(folder());
  EXPECT_EQ(files.read_notes("a.json"), "");
  constexpr std::string_view kNotes =
      R"({"schema": "raystage/shot_notes/1", "notes": [{"frame": 7, "text": "soft", "author": "x"}]})";
  EXPECT_TRUE(files.write_notes("a.json", kNotes, ""));
  EXPECT_FALSE(files.write_notes("a.json", kNotes, "")) << "another page wrote some";
  EXPECT_TRUE(files.write_notes("a.json", kNotes, kNotes));
  EXPECT_EQ(files.read_notes("a.json"), kNotes);
  EXPECT_TRUE(file_exists(folder() / "a.notes.json"));
  EXPECT_NE(error_of([&] { files.write_notes("a.json", "{}", ""); }), "");
  write_file_atomically(folder() / "a.notes.json", std::string_view("damaged"));
  EXPECT_NE(error_of([&] { files.write_notes("a.json", kNotes, ""); }), "");
  EXPECT_EQ(read_file(folder() / "a.notes.json"), "damaged");
  std::filesystem::remove(folder() / "a.notes.json");
  write_file_atomically(outside_.path() / "secret", kNotes);
  std::filesystem::create_symlink(outside_.path() / "secret", folder() / "a.notes.json");
  EXPECT_THAT(error_of([&] { files.read_notes("a.json"); }), HasSubstr("a link"));
  EXPECT_THAT(error_of([&] { files.write_notes("a.json", kNotes, ""); }), HasSubstr("a link"));
}

}  // namespace
}  // namespace raystage::replay
