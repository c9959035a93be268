// SPDX-License-Identifier: Apache-2.0
#include "cli/printing.h"

#include <gtest/gtest.h>

namespace raystage::cli {
namespace {

TEST(Printing, NamesCannotLookLikeLinesOfAReport) {
  const std::string name = "t\nEvery frame is intact";
  ::testing::internal::CaptureStdout();
  print("Name\t{:<3}\n", name);
  print(stdout, "{}: {}\n", 3, name.c_str());
  print("one\ntwo\n");  // lines of our own
  EXPECT_EQ(::testing::internal::GetCapturedStdout(),
            "Name\tt\\u000aEvery frame is intact\n3: t\\u000aEvery frame is intact\none\ntwo\n");
  ::testing::internal::CaptureStderr();
  print_error("{}\n", std::string_view(name));
  EXPECT_EQ(::testing::internal::GetCapturedStderr(), "t\\u000aEvery frame is intact\n");
}

TEST(Printing, OfStreamsIsEscapedToo) {
  ::testing::internal::CaptureStdout();
  print("{} has {} cameras\n", "\x1b[2J", 3);
  print(std::string("\x1b\n"));
  print(stdout, "{}\n", "\x07");
  EXPECT_EQ(::testing::internal::GetCapturedStdout(),
            "\\u001b[2J has 3 cameras\n\\u001b\n\\u0007\n");
  ::testing::internal::CaptureStderr();
  print_error("{}\n", "\x1b");
  EXPECT_EQ(::testing::internal::GetCapturedStderr(), "\\u001b\n");
}

}  // namespace
}  // namespace raystage::cli
