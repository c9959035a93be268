// SPDX-License-Identifier: Apache-2.0
// Views between the ticks of a moving scene against the simulator's truth at their exact times.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <nlohmann/json.hpp>
#include <string>

#include "testing/test_folder.h"
#include "tests/end_to_end/run_command.h"

namespace raystage {
namespace {

using testing::CommandResult;
using ::testing::HasSubstr;
using testing::run;

class ExactTimeViews : public ::testing::Test {
 protected:
  void SetUp() override {
    const CommandResult made =
        run("raystage simulate stage -q --width 240 --height 160 --seconds 1.2 "
            "--truth-width 156 --truth-height 104 --truth-views 6 -o '" +
            take() + "' && raystage sync -q '" + take() + "'");
    ASSERT_EQ(made.exit_code, 0) << made.err;
  }
  std::string take() const { return (folder_.path() / "take").string(); }

  nlohmann::json evaluate(const std::string& options) const {
    const std::string file = (folder_.path() / "evaluation.json").string();
    const CommandResult result =
        run("raystage evaluate '" + take() + "' '" + take() +
            "/views.json' -q --no-pixel-counts --json '" + file + "' " + options);
    EXPECT_EQ(result.exit_code, 0) << result.err;
    return nlohmann::json::parse(std::ifstream(file));
  }

  testing::TestFolder folder_;
};

// Pictures of 240 x 160 pixels gain 1.3 to 1.8 dB. tests/bench/regions.py measures larger ones,
// which gain 4.
TEST_F(ExactTimeViews, AreNearerToTheTruthThanTheNearestTick) {
  for (const std::string method : {"plane_sweep", "depth"}) {
    const auto tick = evaluate("--method " + method);
    const auto exact = evaluate("--exact-times --method " + method);
    EXPECT_FALSE(tick["exact_times"]);
    EXPECT_TRUE(exact["exact_times"]);
    EXPECT_GE(exact["mean"]["psnr_db"].get<double>(), tick["mean"]["psnr_db"].get<double>() + 1.2)
        << method;
    const auto edges = [](const nlohmann::json& of) {
      return of["mean"]["regions"]["edge_band"]["psnr_db"].get<double>();
    };
    EXPECT_GE(edges(exact), edges(tick) + 1.4) << method;
  }
}

// Results that are kept from view to view are those of each view's time.
TEST_F(ExactTimeViews, DoNotDependOnTheViewsBefore) {
  const auto all = evaluate("--exact-times --method depth")["views"];
  const auto third = evaluate("--exact-times --method depth --view-step 3")["views"];
  ASSERT_EQ(third.size(), 2U);
  for (std::size_t i = 0; i < third.size(); ++i) {
    EXPECT_EQ(third[i]["id"], all[3 * i]["id"]);
    EXPECT_EQ(third[i]["psnr_db"], all[3 * i]["psnr_db"]);
  }
}

// The truth of an excluded camera is its frame, at its own time.
TEST_F(ExactTimeViews, OfACameraThatIsExcluded) {
  const double tick = evaluate("--method plane_sweep --exclude-cameras r3c3")["mean"]["psnr_db"];
  const double exact =
      evaluate("--method plane_sweep --exact-times --exclude-cameras r3c3")["mean"]["psnr_db"];
  EXPECT_GT(exact, tick + 0.5);
}

TEST_F(ExactTimeViews, NeedATimeline) {
  const CommandResult refused = run("rm '" + take() + "/timeline.zst' && raystage evaluate '" +
                                    take() + "' '" + take() + "/views.json' -q --exact-times");
  EXPECT_EQ(refused.exit_code, 2) << refused.err;
}

}  // namespace
}  // namespace raystage
