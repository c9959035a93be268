// SPDX-License-Identifier: Apache-2.0
// Commands that write another form of a take are killed throughout their run.
#include <filesystem>
#include <string>
#include <vector>

#include "testing/cli/render_command_test_data.h"
#include "testing/cli/running_command.h"

namespace raystage::testing {
namespace {

namespace fs = std::filesystem;
using ::testing::IsEmpty;

struct KilledForm {
  const char* name;
  const char* program;
  std::vector<std::string> options;
  int moments;
  bool is_repeated;  ///< whether a whole run follows each killed one, or only the last
};

class KilledPack : public RenderCommandTest, public ::testing::WithParamInterface<KilledForm> {
 protected:
  void SetUp() override {
    RenderCommandTest::SetUp();
    if (std::string(GetParam().program) != "raystage-unpack") return;
    ASSERT_EQ(run_raystage("pack -q " + quoted("take") + " -o " + quoted("other")).exit_code, 0);
    fs::remove_all(path("take"));
    fs::rename(path("other"), path("take"));
  }
  CommandWords words() const {
    CommandWords all{GetParam().program, path("take").string(), "-o", path("target").string(),
                     "-q"};
    all.insert(all.end(), GetParam().options.begin(), GetParam().options.end());
    return all;
  }
  /// Expects the target of an undisturbed run, and removes it.
  void expect_whole_target() {
    EXPECT_THAT(different_files(path("target"), path("whole")), IsEmpty());
    fs::remove_all(path("target"));
  }
  void run_to_the_end() {
    EXPECT_EQ(RunningCommand(words()).wait(), 0);
    expect_whole_target();
    for (const auto& entry : fs::directory_iterator(folder_.path())) {
      EXPECT_FALSE(entry.path().filename().string().starts_with(".")) << entry << " is left behind";
    }
  }
};

TEST_P(KilledPack, KeepsTheSourceAndItsTargetIsAbsentOrWhole) {
  const auto source = files_under(path("take"));
  int runs = 0;
  const auto after_run = [&](int exit_code) {
    ASSERT_EQ(exit_code, 0);
    if (runs++ > 0) return expect_whole_target();
    fs::rename(path("target"), path("whole"));
  };
  const auto after_kill = [&] {
    EXPECT_TRUE(files_under(path("take")) == source);
    if (fs::exists(path("target"))) expect_whole_target();
    if (GetParam().is_repeated) run_to_the_end();
  };
  ASSERT_NO_FATAL_FAILURE(kill_throughout(words(), GetParam().moments, after_run, after_kill));
  run_to_the_end();
  EXPECT_TRUE(files_under(path("take")) == source);
  EXPECT_EQ(run_raystage("verify --decode -q " + quoted("whole")).exit_code, 0);
}

INSTANTIATE_TEST_SUITE_P(
    Forms, KilledPack,
    ::testing::Values(KilledForm{"pack", "raystage-pack", {}, 10, true},
                      KilledForm{"unpack", "raystage-unpack", {}, 10, true},
                      KilledForm{"hevc", "raystage-pack", {"--temporal", "hevc"}, 8, true},
                      KilledForm{"av1", "raystage-pack", {"--temporal", "av1"}, 8, true},
                      KilledForm{"hevc_cameras",
                                 "raystage-pack",
                                 {"--temporal", "hevc", "--references", "cameras"},
                                 8,
                                 true},
                      KilledForm{"av1_cameras",
                                 "raystage-pack",
                                 {"--temporal", "av1", "--references", "cameras"},
                                 8,
                                 true},
                      KilledForm{
                          "target_db",
                          "raystage-pack",
                          {"--temporal", "hevc", "--target-db", "3", "--method", "focal_plane"},
                          4,
                          false}),
    [](const auto& test) { return test.param.name; });

}  // namespace
}  // namespace raystage::testing
