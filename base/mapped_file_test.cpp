// SPDX-License-Identifier: Apache-2.0
#include "base/mapped_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <cstddef>
#include <cstdlib>
#include <fstream>
#include <string>

#include "base/error.h"
#include "testing/test_folder.h"

namespace raystage {
namespace {

using ::testing::HasSubstr;

constexpr std::size_t kBytes = 1 << 20;

class MappedFiles : public ::testing::Test {
 protected:
  MappedFiles() { std::ofstream(file_, std::ios::binary) << std::string(kBytes, 'x'); }

  static std::size_t count_of(const MappedFile& mapped, char wanted) {
    return static_cast<std::size_t>(
        std::ranges::count(mapped.bytes(), static_cast<std::byte>(wanted)));
  }
  static std::string message_of(const MappedFile& mapped) {
    try {
      mapped.check_read();
      return "";
    } catch (const Error& error) {
      EXPECT_EQ(error.exit_code(), ExitCode::kFailed);
      return error.what();
    }
  }

  testing::TestFolder folder_;
  std::filesystem::path file_ = folder_.path() / "file";
};

TEST_F(MappedFiles, AreReadWhole) {
  const MappedFile mapped(file_);
  EXPECT_EQ(count_of(mapped, 'x'), kBytes);
  EXPECT_NO_THROW(mapped.check_read());
  EXPECT_EQ(read_mapped([&] { return count_of(mapped, 'x'); }, mapped), kBytes);
}

TEST_F(MappedFiles, TruncatedOnesReadAsZerosAndAreAnError) {
  constexpr std::size_t kRest = 10'000;  // not a whole number of pages
  const MappedFile mapped(file_), another(file_);
  EXPECT_EQ(message_of(mapped), "");
  ASSERT_EQ(truncate(file_.c_str(), kRest), 0);
  EXPECT_EQ(count_of(mapped, 'x'), kRest);
  EXPECT_EQ(count_of(mapped, '\0'), kBytes - kRest);
  for (const MappedFile* each : {&mapped, &another}) {  // also where the lost part was not read
    EXPECT_THAT(message_of(*each), HasSubstr("another program truncated the file"));
    EXPECT_THAT(message_of(*each), HasSubstr(file_.string()));
  }
}

TEST_F(MappedFiles, TruncatedAndWrittenAgainTheyAreAnErrorIfZerosWereRead) {
  const MappedFile mapped(file_);
  ASSERT_EQ(truncate(file_.c_str(), 0), 0);
  EXPECT_EQ(count_of(mapped, 'x'), 0U);
  ASSERT_EQ(truncate(file_.c_str(), kBytes), 0);
  EXPECT_THAT(message_of(mapped), HasSubstr("cannot read all of the file"));
}

TEST_F(MappedFiles, WorkThatFailsOnZerosFailsForTheirReason) {
  const MappedFile mapped(file_);
  ASSERT_EQ(truncate(file_.c_str(), 0), 0);
  try {
    read_mapped([&]() -> int { throw Error::bad_input("damaged", "inside", "Repair"); }, mapped);
    FAIL() << "no error";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("truncated"));
  }
  const MappedFile whole(file_);
  EXPECT_THROW(read_mapped([&]() -> int { throw 5; }, whole), int);
}

TEST_F(MappedFiles, TheNextMappingStartsAnew) {
  for (int i = 0; i < 100; ++i) {
    std::ofstream(file_, std::ios::binary) << std::string(kBytes, 'x');
    const MappedFile mapped(file_);
    EXPECT_NO_THROW(mapped.check_read());
    ASSERT_EQ(truncate(file_.c_str(), 0), 0);
    EXPECT_EQ(count_of(mapped, '\0'), kBytes);
  }
}

TEST_F(MappedFiles, OtherBusErrorsStillEndTheProcess) {
  ::testing::FLAGS_gtest_death_test_style = "threadsafe";
  const MappedFile mapped(file_);
  // A sanitizer's handler reports the signal and ends with 1 instead.
  const auto ended = [](int status) {
    return WIFSIGNALED(status) || (WIFEXITED(status) && WEXITSTATUS(status) != 0);
  };
  EXPECT_EXIT(
      {
        raise(SIGBUS);
        std::_Exit(0);
      },
      ended, "");
}

}  // namespace
}  // namespace raystage
