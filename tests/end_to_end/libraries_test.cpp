// SPDX-License-Identifier: Apache-2.0
// Tests which libraries commands load: OpenImageIO or OpenCV takes 0.2 s and 100 MB per start.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "testing/test_paths.h"
#include "tests/end_to_end/run_command.h"

namespace raystage {
namespace {

using testing::CommandResult;
using ::testing::HasSubstr;
using ::testing::Not;
using testing::run;

class LibrariesLoadedBy : public ::testing::TestWithParam<const char*> {};

TEST_P(LibrariesLoadedBy, NoneOfAnImageStack) {
  const CommandResult loaded =
      run("ldd '" + testing::commands_folder().string() + "/raystage-" + GetParam() + "'");
  ASSERT_EQ(loaded.exit_code, 0) << loaded.err;
  EXPECT_THAT(loaded.out, HasSubstr("libstdc++"));
  for (const char* library : {"libOpenImageIO", "libopencv", "libassimp", "libOpenEXR"}) {
    EXPECT_THAT(loaded.out, Not(HasSubstr(library)));
  }
  // FFmpeg, which records cameras, has its own decoder of JPEG XL.
  if (loaded.out.find("libavcodec") == std::string::npos) {
    EXPECT_THAT(loaded.out, Not(HasSubstr("libjxl")));
  }
}

INSTANTIATE_TEST_SUITE_P(Commands, LibrariesLoadedBy,
                         ::testing::Values("record", "join", "info", "verify", "repair", "pack",
                                           "unpack", "bag"));

class LibrariesOfFrameReadersLoadedBy : public ::testing::TestWithParam<const char*> {};

TEST_P(LibrariesOfFrameReadersLoadedBy, NoneForMotionTexturesOrMeshes) {
  const CommandResult loaded =
      run("ldd '" + testing::commands_folder().string() + "/raystage-" + GetParam() + "'");
  ASSERT_EQ(loaded.exit_code, 0) << loaded.err;
  for (const char* library : {"libOpenImageIO", "libopencv", "libassimp"}) {
    EXPECT_THAT(loaded.out, Not(HasSubstr(library)));
  }
}

INSTANTIATE_TEST_SUITE_P(Commands, LibrariesOfFrameReadersLoadedBy,
                         ::testing::Values("render", "prepare", "proxy", "sync", "farm"));

TEST(LibrariesLoadedByRaystage, AreThoseOfCAlone) {
  const CommandResult loaded = run("ldd '" + testing::commands_folder().string() + "/raystage'");
  ASSERT_EQ(loaded.exit_code, 0) << loaded.err;
  EXPECT_THAT(loaded.out, HasSubstr("libc.so"));
  EXPECT_THAT(loaded.out, Not(HasSubstr("libstdc++")));
  EXPECT_THAT(loaded.out, Not(HasSubstr("libhwy")));
}

}  // namespace
}  // namespace raystage
