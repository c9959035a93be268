// SPDX-License-Identifier: Apache-2.0
// raystage render as a farm runs it.
#include <hwy/targets.h>

#include "render/common/simd_level.h"
#include "testing/cli/render_command_test_data.h"

namespace raystage::cli {
namespace {

using ::testing::HasSubstr;

class RenderCommand : public testing::RenderCommandTest {};

TEST_F(RenderCommand, OneSimdLevelGivesTheSameBytes) {
  for (const char* method : {"focal_plane", "depth"}) {
    shot_.layers[0].method = method;
    for (const render::SimdLevel level : render::simd_levels()) {
      const std::string name(render::simd_level_name(level));
      const std::string out = method + ("." + name);
      const std::string options = "--simd " + name;
      std::filesystem::remove_all(path("take") / "depth");  // estimated again at this level
      const testing::CommandResult first = render(out, options);
      ASSERT_EQ(first.exit_code, 0) << first.output;
      EXPECT_THAT(first.output, HasSubstr(", simd " + name + ", SHOT"));
      std::filesystem::remove_all(path("take") / "depth");
      ASSERT_EQ(render(out + ".again", options).exit_code, 0);
      EXPECT_EQ(testing::files_under(path(out)).size(), kFrames);
      EXPECT_TRUE(testing::files_under(path(out)) == testing::files_under(path(out + ".again")))
          << out;
    }
    // By default it is the best level.
    std::filesystem::remove_all(path("take") / "depth");
    const std::string best(render::simd_level_name(render::best_simd_level()));
    const testing::CommandResult plain = render(method + std::string(".plain"));
    EXPECT_THAT(plain.output, HasSubstr(", simd " + best + ", SHOT"));
    EXPECT_TRUE(testing::files_under(path(method + std::string(".plain"))) ==
                testing::files_under(path(method + ("." + best))));
  }
}

#if HWY_ARCH_X86
TEST_F(RenderCommand, KernelsAndLibmRunAtTheLevelThatIsPinned) {
  if (render::simd_levels().size() < 2) GTEST_SKIP() << "this processor has one level";
  // Levels round differently. The bytes would be equal if the levels were not pinned.
  shot_.layers[0].method = "depth";
  for (const char* level : {"sse4", "avx2"}) {
    std::filesystem::remove_all(path("take") / "depth");
    ASSERT_EQ(render(level, std::string("--simd ") + level).exit_code, 0);
  }
  EXPECT_FALSE(testing::files_under(path("sse4")) == testing::files_under(path("avx2")));
}
#endif

TEST_F(RenderCommand, UnknownLevelsAreBadUsage) {
  const testing::CommandResult result = render("out", "--simd avx");
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_THAT(result.output, HasSubstr("--simd"));
  EXPECT_FALSE(std::filesystem::exists(path("out")));
}

TEST_F(RenderCommand, TakesPathsFromAnotherFolder) {
  shot_.layers[0].method = "focal_plane";
  ASSERT_EQ(render("out").exit_code, 0);
  const auto before = testing::files_under(path("out"));
  create_folder(path("job"));
  std::filesystem::rename(path("shot.json"), path("job") / "snapshot.json");
  const std::string command = "render " + quoted("job/snapshot.json") + " --progress none -o '" +
                              (path("out") / "f.####.exr").string() + "' ";
  EXPECT_EQ(testing::run_raystage(command + "--existing skip").exit_code, 2);
  const std::string there = command + "--relative-to " + quoted("") + " --existing ";
  const testing::CommandResult skipped = testing::run_raystage(there + "skip");
  EXPECT_EQ(skipped.exit_code, 0) << skipped.output;
  EXPECT_THAT(skipped.output, HasSubstr("0 of 2 frames rendered, 2 existed already"));
  ASSERT_EQ(testing::run_raystage(there + "overwrite").exit_code, 0);
  EXPECT_TRUE(testing::files_under(path("out")) == before);
}

TEST_F(RenderCommand, AnUnknownMethodIsToldTheNamesHoweverItIsSpelt) {
  for (const char* method : {"dept", "Depth"}) {
    shot_.layers[0].method = method;
    const testing::CommandResult refused = render("out");
    EXPECT_EQ(refused.exit_code, 2);
    EXPECT_THAT(refused.output, HasSubstr("Use one of focal_plane, nearest"));
    EXPECT_THAT(refused.output, HasSubstr(method));
  }
  shot_.layers[0].method = "\x1b[31mred";
  EXPECT_THAT(render("out").output, HasSubstr("\\u001b[31mred"));
}

}  // namespace
}  // namespace raystage::cli
