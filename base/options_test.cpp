// SPDX-License-Identifier: Apache-2.0
#include "base/options.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

namespace raystage {
namespace {

struct ZoomOptions {
  double factor = 1;
  bool is_valid(std::string* reason) const { return is_within("factor", factor, 0.5, 8, reason); }
};

TEST(Options, ReasonNamesTheValueAndItsRange) {
  std::string reason;
  EXPECT_TRUE(is_within("zoom", 0.5, 0.5, 8, &reason));
  EXPECT_TRUE(is_within("zoom", 8, 0.5, 8, &reason));
  EXPECT_EQ(reason, "");
  EXPECT_FALSE(is_within("zoom", 9, 0.5, 8, &reason));
  EXPECT_EQ(reason, "zoom is 9, allowed: 0.5 to 8");
  EXPECT_FALSE(is_within("zoom", std::numeric_limits<double>::quiet_NaN(), 0.5, 8, &reason));
}

TEST(Options, InvalidOnesAreBadInput) {
  EXPECT_NO_THROW(require_valid(ZoomOptions{}));
  try {
    require_valid(ZoomOptions{.factor = 0}, "lens.json");
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.exit_code(), ExitCode::kBadInput);
    EXPECT_THAT(error.what(), ::testing::StartsWith("lens.json: factor is 0, allowed: 0.5 to 8"));
  }
}

}  // namespace
}  // namespace raystage
