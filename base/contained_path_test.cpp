// SPDX-License-Identifier: Apache-2.0
#include "base/contained_path.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <stdlib.h>  // setenv is POSIX
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <string>

#include "base/atomic_file.h"
#include "base/error.h"
#include "base/mapped_file.h"
#include "testing/test_folder.h"

namespace raystage {
namespace {

namespace fs = std::filesystem;

class ContainedPaths : public ::testing::Test {
 protected:
  void SetUp() override {
    fs::create_directories(take_ / "archive");
    write_file_atomically(take_ / "archive/a.mkv", std::string_view("inside"));
    write_file_atomically(folder_.path() / "secret", std::string_view("outside"));
    fs::create_symlink("../secret", take_ / "link");
    fs::create_symlink("archive/a.mkv", take_ / "link_within");
    fs::create_symlink("..", take_ / "up");
    fs::create_symlink("/", take_ / "root");
    fs::create_symlink("nowhere", take_ / "broken");
    fs::create_symlink("take", folder_.path() / "take_link");
    ASSERT_EQ(mkfifo((take_ / "pipe").c_str(), 0600), 0);
  }
  /// Returns 0 or errno; both ways to open must agree.
  int result(const fs::path& relative, int flags = O_RDONLY) const {
    errno = 0;
    const bool opens = open_contained({take_, relative}, flags, 0600).open();
    const int reason = opens ? 0 : errno;
    const bool opens_by_parts = open_contained_by_parts({take_, relative}, flags, 0600).open();
    EXPECT_EQ(opens_by_parts ? 0 : errno, reason) << relative;
    return reason;
  }
  testing::TestFolder folder_;
  const fs::path take_ = folder_.path() / "take";
};

TEST_F(ContainedPaths, AreReadThroughLinksOnlyOnRequest) {
  const auto read = [&](const fs::path& name) { return read_file(ContainedPath{take_, name}); };
  EXPECT_EQ(read("archive/a.mkv"), "inside");
  for (const char* name :
       {"link", "link_within", "up/secret", "up/take/archive/a.mkv", "broken", "../secret",
        "archive/../../secret", "root/etc/passwd", "pipe", "archive"}) {
    EXPECT_THROW(read(name), Error) << name;
    EXPECT_THROW(InputFile(ContainedPath{take_, name}), Error) << name;
    EXPECT_THROW(MappedFile(ContainedPath{take_, name}), Error) << name;
    std::byte first{};
    EXPECT_EQ(read_file_part(ContainedPath{take_, name}, 0, {&first, 1}), 0u) << name;
  }
  ASSERT_EQ(setenv(kFollowLinksVariable, "1", 1), 0);
  EXPECT_EQ(read("link"), "outside");
  EXPECT_EQ(read("up/secret"), "outside");
  EXPECT_EQ(read("archive/a.mkv"), "inside");
  for (const char* name : {"broken", "../secret", "archive/../../secret", "pipe", "archive"}) {
    EXPECT_THROW(read(name), Error) << name;
  }
  EXPECT_THROW(require_contained({take_, "link"}), Error) << "nothing is written through links";
  EXPECT_THROW(OutputFile(ContainedPath{take_, "link"}), Error);
  ASSERT_EQ(unsetenv(kFollowLinksVariable), 0);
  EXPECT_THROW(read("link"), Error);
  EXPECT_NO_THROW(OutputFile(ContainedPath{take_, "archive/a.mkv"}));
}

TEST_F(ContainedPaths, AbsentIsOnlyWhatCannotBeBehindALink) {
  const auto exists_in_take = [&](const fs::path& name) {
    return exists(ContainedPath{take_, name});
  };
  fs::create_symlink("loop", take_ / "loop");
  for (const char* name : {"archive/a.mkv", "archive", "pipe"}) {
    EXPECT_TRUE(exists_in_take(name)) << name;
  }
  for (const char* name : {"missing", "missing/more", "archive/a.mkv/more"}) {
    EXPECT_FALSE(exists_in_take(name)) << name;
  }
  EXPECT_FALSE(exists(ContainedPath{take_ / "missing", "a.mkv"}));
  const std::string long_name = std::string(300, 'x') + ".mkv";
  for (const std::string& name :
       {std::string("loop"), std::string("link"), std::string("broken"), std::string("up/secret"),
        std::string("../secret"), "archive/" + long_name}) {
    try {
      exists_in_take(name);
      ADD_FAILURE() << name;
    } catch (const Error& error) {
      EXPECT_EQ(error.exit_code(), ExitCode::kBadInput);
      EXPECT_THAT(error.where(), ::testing::HasSubstr(name));
    }
  }
  ASSERT_EQ(setenv(kFollowLinksVariable, "1", 1), 0);
  EXPECT_TRUE(exists_in_take("link"));
  EXPECT_FALSE(exists_in_take("broken"));
  EXPECT_THROW(exists_in_take("loop"), Error);
  EXPECT_THROW(exists_in_take("../secret"), Error);
  ASSERT_EQ(unsetenv(kFollowLinksVariable), 0);
}

TEST_F(ContainedPaths, OpenWhatIsInTheFolder) {
  EXPECT_EQ(result("archive/a.mkv"), 0);
  EXPECT_EQ(result("archive"), 0);
  EXPECT_EQ(result("./archive/./a.mkv"), 0);
  EXPECT_EQ(result("archive/new", O_WRONLY | O_CREAT), 0);
  EXPECT_EQ(result("missing"), ENOENT);
  EXPECT_EQ(result("archive/a.mkv/more"), ENOTDIR);
  EXPECT_EQ(result("pipe"), 0) << "at once, without a writer";
  const FileDescriptor through_a_link =
      open_contained({folder_.path() / "take_link", "archive/a.mkv"}, O_RDONLY);
  EXPECT_TRUE(through_a_link.open()) << "the folder itself may be a link";
}

TEST_F(ContainedPaths, LinksAndWaysOutAreRefused) {
  for (const int flags : {O_RDONLY, O_WRONLY | O_CREAT, O_PATH}) {
    for (const char* link : {"link", "link_within", "up/secret", "root/etc/passwd", "broken",
                             "up/take/archive/a.mkv"}) {
      EXPECT_EQ(result(link, flags), ELOOP) << link << " " << flags;
    }
  }
  for (const char* out : {"../secret", "archive/../../secret", "..", "/etc/passwd", ""}) {
    EXPECT_EQ(result(out), EXDEV) << out;
  }
  EXPECT_FALSE(fs::exists(take_ / "nowhere"));
  EXPECT_EQ(read_file(folder_.path() / "secret"), "outside");
}

TEST_F(ContainedPaths, ErrorsNameThePath) {
  const auto refusal = [&](const char* relative) -> std::string {
    try {
      require_contained({take_, relative});
      return "";
    } catch (const Error& error) {
      EXPECT_EQ(error.exit_code(), ExitCode::kBadInput);
      return error.what();
    }
  };
  EXPECT_EQ(refusal("archive/a.mkv"), "");
  EXPECT_EQ(refusal("archive/new/file"), "");
  EXPECT_THAT(refusal("up/secret"),
              ::testing::HasSubstr("take/up/secret: a part of the path is a link"));
  EXPECT_THAT(refusal("../secret"), ::testing::HasSubstr("leaves its folder"));
}

}  // namespace
}  // namespace raystage
