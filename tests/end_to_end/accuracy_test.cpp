// SPDX-License-Identifier: Apache-2.0
// Tests the error of methods that estimate depth on captured light fields with known truth.
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
  double psnr_db, covered;  ///< lower bounds of the mean over all views
};

struct Captured {
  const char* set;
  int views_step;  ///< every n-th view is measured
  std::vector<Accuracy> reached;
  friend void PrintTo(const Captured& captured, std::ostream* out) { *out << captured.set; }
};

class CapturedDepth : public ::testing::TestWithParam<Captured> {};

// Bounds for some views of each set. tests/bench/accuracy.sh measures all views, which takes ten
// times as long; results: docs/benchmarks.md, "Accuracy on captured light fields".
TEST_P(CapturedDepth, ShowsWhatNoCameraSawAsWellAsEver) {
  const Captured& captured = GetParam();
  const auto data = testing::find_captured_data(captured.set);
  if (!data) GTEST_SKIP() << "no captured light field " << captured.set;
  const testing::TestFolder folder;
  std::string take = (folder.path() / "take").string();
  const std::string from = "'" + data->string() + "/import.json'";
  ASSERT_EQ(run("raystage import " + from + " -o '" + take + "' --restart-markers").exit_code, 0);
  if (std::string(captured.set) == "stage") {  // free-running cameras; the truth is at these ticks
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
    EXPECT_GE(mean.at("coverage").get<double>(), reached.covered) << reached.method;
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
