// SPDX-License-Identifier: Apache-2.0
// Tests `raystage bench` as users run it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>

#include <nlohmann/json.hpp>

#include "testing/render/synthetic_take.h"
#include "tests/end_to_end/run_command.h"

namespace raystage {
namespace {

using ::testing::AllOf;
using testing::CommandResult;
using testing::find_files;
using ::testing::HasSubstr;
using ::testing::Not;
using testing::read_text;
using testing::run;
using testing::write_text;

class Bench : public ::testing::Test {
 protected:
  void SetUp() override {
    testing::SyntheticTake settings;
    settings.cameras = testing::camera_grid(3, 3, 0.06, 96, 72);
    settings.has_depth_range = false;
    write_synthetic_take(settings, take_);
  }
  std::string command(const std::string& options) const {
    return "raystage bench '" + take_.string() + "' --exclude-cameras r1c1 -o '" + out_.string() +
           "' " + options;
  }
  nlohmann::json document() const { return nlohmann::json::parse(read_text(out_ / "trade.json")); }

  testing::TestFolder folder_;
  const std::filesystem::path take_ = folder_.path() / "take", out_ = folder_.path() / "out";
};

TEST_F(Bench, WritesTablesAndAPage) {
  const CommandResult result = run(
      command("--focal-depth 4 --setting focal_plane --setting 'one:nearest' -j 1,2 --repeat 1"));
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.out, AllOf(HasSubstr("| one "), HasSubstr("PSNR dB")));
  EXPECT_THAT(result.err, HasSubstr("Progress: 100%"));
  EXPECT_EQ(document()["rows"].size(), 4U);
  EXPECT_EQ(document()["complete"], true);
  // The scene is on the focal plane.
  EXPECT_GT(document()["rows"][0]["psnr_db"].get<double>(), 40);
  EXPECT_GT(document()["rows"][0]["peak_memory_bytes"].get<double>(), 1e6);
  EXPECT_THAT(read_text(out_ / "trade.csv"), HasSubstr("\r\none,nearest,,1,2,"));
  EXPECT_THAT(read_text(out_ / "trade.html"), AllOf(HasSubstr("</html>"), Not(HasSubstr("://"))));
  EXPECT_TRUE(find_files(folder_.path(), ".tmp").empty());
}

TEST_F(Bench, TakesSettingsFromADocument) {
  write_text(folder_.path() / "s.json", R"({"schema": "raystage/bench/1", "settings": [
    {"label": "near", "method": "focal_plane", "focal_depth_m": 2},
    {"label": "right", "method": "focal_plane", "focal_depth_m": 4}]})");
  const std::string settings = "--settings '" + (folder_.path() / "s.json").string() + "' ";
  ASSERT_EQ(run(command(settings)).exit_code, 0);
  const auto rows = document()["rows"];
  EXPECT_GT(rows[1]["psnr_db"].get<double>(), rows[0]["psnr_db"].get<double>() + 3);
  EXPECT_EQ(rows[0]["focal_depth_m"], 2);
  // An explicit setting that cannot be rendered, because the take has no depth range.
  const CommandResult partly = run(command(settings + "--setting focal_plane"));
  EXPECT_EQ(partly.exit_code, 3) << partly.err;
  EXPECT_THAT(partly.err, HasSubstr("no depth range"));
  EXPECT_THAT(document()["rows"][0]["failure"].get<std::string>(), HasSubstr("no depth range"));
  EXPECT_TRUE(document()["rows"][0]["psnr_db"].is_null());
}

TEST_F(Bench, MeasuresRegionsOfTrueDepthsAtExactTimes) {
  const std::string take = (folder_.path() / "still").string();
  const CommandResult made =
      run("raystage simulate still -q --rows 3 --columns 3 --width 160 --height 120 --seconds 0.6 "
          "--truth-width 156 --truth-height 104 --truth-views 1 -o '" +
          take + "' && raystage sync -q '" + take + "'");
  ASSERT_EQ(made.exit_code, 0) << made.err;
  const CommandResult result =
      run("raystage bench '" + take + "' '" + take +
          "/views.json' --setting nearest --exact-times --repeat 1 -o '" + out_.string() + "'");
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_EQ(document()["exact_times"], true);
  EXPECT_THAT(read_text(out_ / "trade.html"), HasSubstr("at their exact times"));
  EXPECT_GT(document()["rows"][0]["edge_psnr_db"].get<double>(), 10);
  EXPECT_GT(document()["rows"][0]["bad_depths_1_px"].get<double>(), 0);
}

TEST_F(Bench, MeasuresEveryMethodUnlessTold) {
  const CommandResult result = run(command("--focal-depth 4 --repeat 1 --quiet"));
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.out, AllOf(HasSubstr("| focal_plane "), HasSubstr("| nearest ")));
  EXPECT_EQ(result.err.find("Progress"), std::string::npos);
}

TEST_F(Bench, WithoutADepthRangeSaysWhatToGive) {
  const CommandResult none = run(command("--repeat 1"));
  EXPECT_EQ(none.exit_code, 2) << none.err;
  EXPECT_THAT(none.err, AllOf(HasSubstr("no depth range"), HasSubstr("--focal-depth"),
                              HasSubstr(take_.string()), Not(HasSubstr("unexpected"))));
  // With a focal plane, methods that need a depth range report that in their rows; others succeed.
  ASSERT_EQ(run(command("--focal-depth 4 --repeat 1 --quiet")).exit_code, 0);
  int measured = 0;
  const auto rows = document()["rows"];
  for (const auto& row : rows) {
    const std::string method = row["method"];
    SCOPED_TRACE(method);
    if (row["psnr_db"].is_number()) {
      EXPECT_TRUE(method != "plane_sweep" && method != "depth");
      ++measured;
    } else {
      EXPECT_THAT(row["failure"].get<std::string>(),
                  HasSubstr(method == "visual_hull" ? "matte" : "depth range of the scene"));
    }
  }
  EXPECT_GE(measured, 5);
}

TEST_F(Bench, BadUsageIsNamed) {
  for (const char* options :
       {"--setting no_method", "--setting a:nearest --setting a:focal_plane", "--setting a::x=1",
        "--setting nearest:nearest:option=1", "--focal-depth -1", "--camera-step 0", "--threads -1",
        "--repeat 0", "--settings none.json", "--exclude-cameras nobody", "--images -1",
        "--crops 49"}) {
    SCOPED_TRACE(options);
    const CommandResult result = run(command(options));
    EXPECT_EQ(result.exit_code, 2) << result.err;
    EXPECT_THAT(result.err, Not(HasSubstr("unexpected")));
  }
  EXPECT_EQ(run("raystage bench '" + take_.string() + "' --focal-depth 4").exit_code, 2);
  EXPECT_FALSE(std::filesystem::exists(out_ / "trade.json"));
}

TEST_F(Bench, ASignalLeavesWhatIsFinished) {
  std::string settings;
  for (int i = 0; i < 200; ++i) settings += "--setting s" + std::to_string(i) + ":nearest ";
  const CommandResult result = testing::run_and_signal(
      command("--focal-depth 4 --repeat 1000 " + settings), SIGINT, out_ / "trade.csv");
  EXPECT_EQ(result.exit_code, 128 + SIGINT) << result.err;
  EXPECT_EQ(document()["complete"], false);
  EXPECT_GE(document()["rows"].size(), 1U);
  EXPECT_LT(document()["rows"].size(), 200U);
  EXPECT_THAT(read_text(out_ / "trade.html"), HasSubstr("before it was stopped"));
  EXPECT_TRUE(find_files(folder_.path(), ".tmp").empty());
}

}  // namespace
}  // namespace raystage
