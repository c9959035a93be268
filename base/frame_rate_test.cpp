// SPDX-License-Identifier: Apache-2.0
#include "base/frame_rate.h"

#include <gtest/gtest.h>

namespace raystage {
namespace {

TEST(FrameRate, NumbersStandForThemselves) {
  EXPECT_EQ(frame_rate_from(24.0), (FrameRate{24, 1}));
  EXPECT_EQ(frame_rate_from(12.5), (FrameRate{25, 2}));
  EXPECT_EQ(frame_rate_from(0.1), (FrameRate{1, 10}));
  EXPECT_EQ(frame_rate_from(1000.0), (FrameRate{1000, 1}));
}

TEST(FrameRate, TelevisionRatesAreExact) {
  for (const double fps : {23.976, 23.98, 23.976023976}) {
    EXPECT_EQ(frame_rate_from(fps), (FrameRate{24000, 1001})) << fps;
  }
  EXPECT_EQ(frame_rate_from(29.97), (FrameRate{30000, 1001}));
  EXPECT_EQ(frame_rate_from(59.94), (FrameRate{60000, 1001}));
}

TEST(FrameRate, RatiosAreTakenAsTheyStand) {
  EXPECT_EQ(frame_rate_from("24000/1001"), (FrameRate{24000, 1001}));
  EXPECT_EQ(frame_rate_from("50/2"), (FrameRate{50, 2}));
}

TEST(FrameRate, OthersAreRefused) {
  for (const double fps : {0.0, -24.0, 1000.5, 1e-9, 1.0 / 3}) {
    EXPECT_FALSE(frame_rate_from(fps)) << fps;
  }
  for (const char* text : {"", "24", "24/", "/1", "24/0", "0/1", "-24/1", "24/1x", "24 / 1",
                           "99999999999/1", "1001/1", "1000000/1"}) {
    EXPECT_FALSE(frame_rate_from(text)) << text;
  }
}

}  // namespace
}  // namespace raystage
