// SPDX-License-Identifier: Apache-2.0
#include "replay/permitted_paths.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/atomic_file.h"
#include "base/error.h"
#include "testing/test_folder.h"

namespace raystage::replay {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;

constexpr const char* kShotOfATakeElsewhere = R"({
  "schema": "raystage/shot/2", "name": "test", "width": 64, "height": 48, "fps": 24, "first_frame": 1, "last_frame": 2,
  "camera": {"keys": [{"frame": 1, "position": [0, 0, 0], "horizontal_fov_deg": 40}]},
  "layers": [{"name": "a", "take": "../../takes/one"}]
})";

std::string shot_of_take(const std::string& take) {
  return fmt::format(R"({{"layers": [{{"take": "{}"}}]}})", take);
}

class PermittedPathsTest : public ::testing::Test {
 protected:
  std::string refusal(const std::string& text, const std::string& file = "scenes/a.json") {
    try {
      permitted_.check(file, text);
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  }

  testing::TestFolder parent_;
  const fs::path folder_ = (create_folder(parent_.path() / "shots" / "scenes"),
                            create_folder(parent_.path() / "secret"), parent_.path() / "shots");
  const ShotFiles files_{folder_};
  PermittedPaths permitted_{files_};
};

TEST_F(PermittedPathsTest, AreThoseBelowTheFolder) {
  const std::vector<std::string> inside{"take", "../take", ".", "../scenes/../take/",
                                        (folder_ / "take").string()};
  for (const std::string& take : inside) EXPECT_EQ(refusal(shot_of_take(take)), "") << take;
  fs::create_directory_symlink(parent_.path() / "secret", folder_ / "link");
  const std::vector<std::string> outside{
      "../../secret", "/etc", "/", "../link", "../link/a", (parent_.path() / "secret").string(),
      "../../shots2"};
  for (const std::string& take : outside) {
    EXPECT_THAT(refusal(shot_of_take(take)),
                AllOf(HasSubstr("outside of the viewer's folder"), HasSubstr(folder_.string())))
        << take;
  }
  // Wherever a shot has a path, and whether it exists or not.
  for (const char* const text :
       {R"({"camera": {"file": {"path": "/etc/passwd"}}})",
        R"({"layers": [{"plate": {"file": "/no/such/p.####.exr"}}]})",
        R"({"layers": [{}, {"geometry": {"file": "../../secret/a.obj"}}]})",
        R"({"lights": [{"environment": "/sky.exr"}]})",
        R"({"output": {"color": {"config": "../../config.ocio"}}})",
        R"({"output": {"color": {"config": "../link/../config.ocio"}}})",
        R"({"layers": [{"take": "take", "options": {"mesh": "/etc/passwd"}}]})",
        R"({"layers": [{"take": "take", "options": {"objects": "../../../secret/a"}}]})",
        R"({"layers": [{"options": {"depth_map": "../../../a.exr"}}]})"}) {
    EXPECT_THAT(refusal(text), HasSubstr("outside of the viewer's folder")) << text;
  }
  EXPECT_EQ(refusal(R"({"layers": [{"take": "take", "options": {"mesh": "../mesh/a.obj",
                      "proxy": "mesh", "near": 3}}]})"),
            "");
  EXPECT_THAT(refusal(shot_of_take(std::string(300, 'a'))), HasSubstr("cannot be examined"));
  EXPECT_NE(refusal("[", "scenes/a.json"), "");
  EXPECT_NE(refusal(shot_of_take("take"), "../a.json"), "") << "the shot itself is outside";
}

TEST_F(PermittedPathsTest, AreThoseThatTheUsersShotsName) {
  const std::string text = shot_of_take("../../takes/one");
  EXPECT_NE(refusal(text), "");
  permitted_.permit("scenes/a.json", text);
  EXPECT_EQ(refusal(text), "");
  EXPECT_EQ(refusal(shot_of_take("../takes/one"), "b.json"), "") << "of another folder";
  EXPECT_NE(refusal(shot_of_take("../../takes/two")), "");
  EXPECT_NE(refusal(shot_of_take("../../takes")), "");
  EXPECT_EQ(refusal(R"({"layers": [{"take": "../../takes/one", "options": {"proxy": "depth"}}]})"),
            "");
  // What is behind the link is another folder.
  fs::create_directory_symlink(parent_.path() / "secret", folder_ / "link");
  EXPECT_NE(refusal(shot_of_take("../link/../../takes/one")), "");
}

TEST_F(PermittedPathsTest, AreKnownFromTheFileOfAShotThatIsNotOpenedAgain) {
  const std::string text = shot_of_take("../../takes/one");
  write_file_atomically(folder_ / "scenes" / "a.json", text);
  EXPECT_NE(refusal(text), "") << "this is no shot";
  write_file_atomically(folder_ / "scenes" / "a.json", std::string_view(kShotOfATakeElsewhere));
  EXPECT_EQ(refusal(text), "");
  EXPECT_NE(refusal(shot_of_take("../../takes/two")), "");
}

}  // namespace
}  // namespace raystage::replay
