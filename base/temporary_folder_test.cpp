// SPDX-License-Identifier: Apache-2.0
#include "base/temporary_folder.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/file.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <fstream>
#include <string>
#include <vector>

#include "base/atomic_file.h"
#include "base/resources.h"
#include "testing/test_folder.h"

namespace raystage::temporary_folder_test {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

class TemporaryFolders : public ::testing::Test {
 protected:
  std::vector<std::string> names() const {
    std::vector<std::string> result;
    for (const auto& entry : std::filesystem::directory_iterator(folder_.path())) {
      result.push_back(entry.path().filename().string());
    }
    return result;
  }
  std::filesystem::path target() const { return folder_.path() / "a"; }

  /// Returns the number of a process that wrote files into a temporary folder and was killed.
  pid_t kill_a_writer() const {
    const pid_t child = fork();
    if (child == 0) {
      const TemporaryFolder temporary(target());
      std::filesystem::create_directory(temporary.path() / "sub");
      std::ofstream(temporary.path() / "sub" / "file") << "half";
      kill(getpid(), SIGKILL);
    }
    waitpid(child, nullptr, 0);
    return child;
  }

  testing::TestFolder folder_;
};

TEST_F(TemporaryFolders, ATargetAppearsWholeOrNotAtAll) {
  {
    const TemporaryFolder temporary(target());
    std::ofstream(temporary.path() / "file") << "half";
    EXPECT_FALSE(file_exists(target()));
  }
  EXPECT_THAT(names(), IsEmpty());
  TemporaryFolder temporary(target() / "");
  EXPECT_EQ(temporary.target(), target());
  std::ofstream(temporary.path() / "file") << "whole";
  ASSERT_TRUE(temporary.commit());
  EXPECT_THAT(names(), ElementsAre("a"));
  EXPECT_TRUE(file_exists(target() / "file"));
}

TEST_F(TemporaryFolders, ATargetThatExistsStays) {
  {
    TemporaryFolder temporary(target());
    std::ofstream(target()) << "a file";
    EXPECT_FALSE(temporary.commit());
    EXPECT_EQ(errno, EEXIST);
  }
  EXPECT_THAT(names(), ElementsAre("a"));
  EXPECT_EQ(read_file(target()), "a file");
}

TEST_F(TemporaryFolders, WhatAKilledProcessLeftIsRemovedByTheNextOne) {
  kill_a_writer();
  ASSERT_EQ(names().size(), 1u);
  TemporaryFolder temporary(target());
  EXPECT_EQ(names(), std::vector<std::string>{temporary.path().filename().string()});
  ASSERT_TRUE(temporary.commit());
  EXPECT_THAT(names(), ElementsAre("a"));
}

TEST_F(TemporaryFolders, WhatLivesStays) {
  const TemporaryFolder first(target());
  const TemporaryFolder second(target());
  EXPECT_TRUE(file_exists(first.path()));
  // A process of another container lives, though its number is that of none here.
  const pid_t ended = kill_a_writer();
  ASSERT_EQ(names().size(), 3u);
  std::filesystem::path left;
  for (const std::string& name : names()) {
    if (name.find("." + std::to_string(ended) + ".") != name.npos) left = folder_.path() / name;
  }
  const int lock = open(left.c_str(), O_RDONLY | O_DIRECTORY);
  ASSERT_EQ(flock(lock, LOCK_EX), 0);
  { const TemporaryFolder third(target()); }
  EXPECT_TRUE(file_exists(left / "sub" / "file"));
  close(lock);
  { const TemporaryFolder third(target()); }
  EXPECT_FALSE(file_exists(left));
}

TEST_F(TemporaryFolders, OnlyAbandonedFoldersOfTheTargetAreRemoved) {
  const pid_t ended = kill_a_writer();
  { const TemporaryFolder removes(target()); }
  const std::string of_ended = "." + host_name() + "." + std::to_string(ended) + ".0123abcd.tmp";
  const std::vector<std::string> kept{
      "a" + of_ended,
      ".ab" + of_ended,
      ".a" + of_ended + ".exr",
      ".a.b" + of_ended,
      ".a.other" + of_ended,
      ".a." + host_name() + ".x.0123.tmp",
      ".a." + host_name() + "." + std::to_string(ended) + ".tmp",
      ".a." + host_name() + "." + std::to_string(ended) + ".xy.tmp"};
  for (const std::string& name : kept) std::filesystem::create_directory(folder_.path() / name);
  // Neither a file nor what a link leads to.
  std::ofstream(folder_.path() / (".a." + host_name() + "." + std::to_string(ended) + ".1.tmp"));
  std::filesystem::create_directory(folder_.path() / "elsewhere");
  std::ofstream(folder_.path() / "elsewhere" / "file") << "kept";
  const std::filesystem::path link =
      folder_.path() / (".a." + host_name() + "." + std::to_string(ended) + ".2.tmp");
  std::filesystem::create_symlink("elsewhere", link);
  std::filesystem::create_directory(folder_.path() / (".a" + of_ended));
  const std::size_t count = names().size();
  { const TemporaryFolder removes(target()); }
  EXPECT_EQ(names().size(), count - 1);
  EXPECT_FALSE(file_exists(folder_.path() / (".a" + of_ended)));
  EXPECT_TRUE(std::filesystem::is_symlink(link));
  EXPECT_TRUE(file_exists(folder_.path() / "elsewhere" / "file"));
  for (const std::string& name : kept) EXPECT_TRUE(file_exists(folder_.path() / name)) << name;
}

}  // namespace
}  // namespace raystage::temporary_folder_test
