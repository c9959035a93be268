// SPDX-License-Identifier: Apache-2.0
// The clock of a recording while that of the computer is disciplined and set.
#include "ingest/record/host_clock.h"

#include <gtest/gtest.h>

#include "ingest/sources/frame_source.h"

namespace raystage::ingest {
namespace {

constexpr Nanoseconds kHour = 3600 * kNanosecondsPerSecond;
constexpr Nanoseconds kStart = 1'800'000'000 * kNanosecondsPerSecond;  // in 2027

TEST(HostClock, FollowsTheDisciplinedClock) {
  HostClock::Reading now{kStart, 77};
  HostClock clock([&] { return now; });
  for (int i = 0; i < 100'000; ++i) {
    now.steady += kNanosecondsPerSecond / 50;
    now.utc += kNanosecondsPerSecond / 50 + kNanosecondsPerSecond / 100'000;  // 500 ppm
    ASSERT_EQ(clock.utc_at(now.steady - 3), now.utc - 3);
  }
  now.utc += 59 * kNanosecondsPerSecond;  // set by less than a minute
  EXPECT_EQ(clock.utc_at(now.steady), now.utc);
  EXPECT_EQ(clock.ignored_steps(), 0);
}

TEST(HostClock, GoesOnWhereTheClockIsSet) {
  for (const Nanoseconds step : {kHour, -kHour, 57 * 365 * 24 * kHour}) {
    HostClock::Reading now{kStart, 77};
    HostClock clock([&] { return now; });
    now.steady += kNanosecondsPerSecond;
    now.utc += kNanosecondsPerSecond + step;
    EXPECT_EQ(clock.utc_at(now.steady), kStart + kNanosecondsPerSecond);
    EXPECT_EQ(clock.utc_at(now.steady - kNanosecondsPerSecond / 2),
              kStart + kNanosecondsPerSecond / 2)
        << "from before";
    EXPECT_EQ(clock.ignored_steps(), step);
    now.steady += kNanosecondsPerSecond;
    now.utc += kNanosecondsPerSecond - step;  // and back
    EXPECT_EQ(clock.utc_at(now.steady), kStart + 2 * kNanosecondsPerSecond);
    EXPECT_EQ(clock.ignored_steps(), 0);
  }
}

TEST(HostClock, ReadsThisComputers) {
  HostClock clock;
  const Nanoseconds before = host_utc_now(), now = clock.utc_now(), after = host_utc_now();
  EXPECT_GT(now, before - kNanosecondsPerSecond / 100);
  EXPECT_LT(now, after + kNanosecondsPerSecond / 100);
  const Nanoseconds steady = host_steady_now();
  EXPECT_GE(host_steady_now(), steady);
}

}  // namespace
}  // namespace raystage::ingest
