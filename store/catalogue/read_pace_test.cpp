// SPDX-License-Identifier: Apache-2.0
#include "store/catalogue/read_pace.h"

#include <gtest/gtest.h>

namespace raystage::store {
namespace {

using std::chrono::duration;

/// A clock that moves only by waiting.
struct StillClock {
  ReadPace::Clock::time_point now{};
  ReadPace pace(double bytes_per_second) {
    return ReadPace(
        bytes_per_second, [this] { return now; },
        [this](std::chrono::nanoseconds time) { now += time; });
  }
  double seconds() const { return duration<double>(now.time_since_epoch()).count(); }
};

TEST(ReadPace, HoldsTheRateOverManySizes) {
  StillClock clock;
  ReadPace pace = clock.pace(1e6);
  double bytes = 0;
  for (int i = 0; i < 1000; ++i) {
    const std::uint64_t next = 1 + static_cast<std::uint64_t>(i) * 37 % 5000;
    pace.before(next);
    bytes += static_cast<double>(next);
  }
  // What the bucket holds, a quarter of a second, comes at once; the last bytes are not yet paid
  // for.
  EXPECT_NEAR(clock.seconds(), bytes / 1e6 - 0.25, 0.01);
}

TEST(ReadPace, APauseIsNotMadeUpFor) {
  StillClock clock;
  ReadPace pace = clock.pace(1e6);
  clock.now += std::chrono::hours(1);
  const double start = clock.seconds();
  for (int i = 0; i < 100; ++i) pace.before(100'000);
  EXPECT_GT(clock.seconds() - start, 9.5);
}

TEST(ReadPace, WithoutALimitNothingWaits) {
  StillClock clock;
  ReadPace pace = clock.pace(0);
  pace.before(std::uint64_t{1} << 60);
  EXPECT_EQ(clock.seconds(), 0);
}

}  // namespace
}  // namespace raystage::store
