// SPDX-License-Identifier: Apache-2.0
// Views of captured light fields whose truth is known, by the methods that find the depth.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "testing/test_data.h"
#include "testing/test_folder.h"
#include "tests/end_to_end/run_command.h"

namespace raystage {
namespace {

using nlohmann::json;
using testing::CommandResult;
using testing::run;

struct Accuracy {
  const char* method;
  double psnr_db, covered;  ///< at the least, mean over all views
};

struct Captured {
  const char* set;
  int views_step;  ///< every n-th of the views whose truth is known is measured
  std::vector<Accuracy> reached;
  friend void PrintTo(const Captured& captured, std::ostream* out) { *out << captured.set; }
};

class CapturedDepth : public ::testing::TestWithParam<Captured> {};

// Some views of each set, with what those reach: all of them take ten times as long, and are
// measured by tests/bench/accuracy.sh. docs/benchmarks.md, "Accuracy on captured light fields", has
// what that gives, and what limits depth on shop.
TEST_P(CapturedDepth, ShowsWhatNoCameraSawAsWellAsEver) {
  const Captured& captured = GetParam();
  const auto data = testing::find_captured_data(captured.set);
  if (!data) GTEST_SKIP() << "no captured light field " << captured.set;
  const TestFolder folder;
  std::string take = (folder.path() / "take").string();
  const std::string from = "'" + data->string() + "/import.json'";
  ASSERT_EQ(run("raystage import " + from + " -o '" + take + "' --restart-markers").exit_code, 0);
  if (std::string(captured.set) == "stage") {  // cameras run free; truth lies on these ticks
    const CommandResult moved = run("raystage sync '" + take + "' -q -o '" + take +
                                    "_moved' --fps 15 --tick-at 0.233333333 --retime flow");
    ASSERT_EQ(moved.exit_code, 0) << moved.err;
    take += "_moved";
  }
  const std::string file = (folder.path() / "evaluation.json").string();
  for (const Accuracy& reached : captured.reached) {
    const CommandResult result =
        run("raystage evaluate '" + take + "' '" + data->string() + "/views.json' --method " +
            reached.method + " --no-pixel-counts --view-step " +
            std::to_string(captured.views_step) + " --json '" + file + "'");
    ASSERT_EQ(result.exit_code, 0) << result.err;
    const json mean = json::parse(std::ifstream(file)).at("mean");
    RecordProperty(reached.method, std::to_string(mean.at("psnr_db").get<double>()));
    EXPECT_GE(mean.at("psnr_db").get<double>(), reached.psnr_db) << reached.method;
    EXPECT_GE(mean.at("covered").get<double>(), reached.covered) << reached.method;
  }
}

INSTANTIATE_TEST_SUITE_P(
    Sets, CapturedDepth,
    ::testing::Values(
        Captured{"shop", 1, {{"plane_sweep", 34.5, 0.999}, {"depth", 35.1, 0.999}}},
        Captured{"stanford_chess9x9", 8, {{"plane_sweep", 36.9, 0.99}, {"depth", 37.75, 0.99}}},
        Captured{
            "stanford_knights17x17", 16, {{"plane_sweep", 35.95, 0.98}, {"depth", 36.05, 0.98}}},
        Captured{"stage", 7, {{"plane_sweep", 29.5, 0.999}, {"depth", 30.3, 0.999}}}),
    [](const auto& test) { return std::string(test.param.set); });

}  // namespace
}  // namespace raystage
