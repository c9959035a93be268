// SPDX-License-Identifier: Apache-2.0
#include "base/time.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rapidcheck.h>

#include <limits>

#include "base/error.h"

namespace raystage {
namespace {

TEST(Utc, KnownTimes) {
  EXPECT_EQ(parse_utc("1970-01-01T00:00:00Z"), 0);
  EXPECT_EQ(parse_utc("2026-01-01T00:00:00Z"), 1'767'225'600 * kNanosecondsPerSecond);
  EXPECT_EQ(parse_utc("1969-12-31T23:59:59.999999999Z"), -1);
  EXPECT_EQ(parse_utc("2000-02-29T12:34:56.5Z"), 951'827'696 * kNanosecondsPerSecond + 500'000'000);
}

TEST(Utc, ShortestText) {
  EXPECT_EQ(format_utc(0), "1970-01-01T00:00:00Z");
  EXPECT_EQ(format_utc(-1), "1969-12-31T23:59:59.999999999Z");
  EXPECT_EQ(format_utc(1'500'000'000), "1970-01-01T00:00:01.5Z");
  EXPECT_EQ(format_utc(1'000), "1970-01-01T00:00:00.000001Z");
}

TEST(Utc, WholeRangeOfNanoseconds) {
  for (const Nanoseconds time :
       {std::numeric_limits<Nanoseconds>::min(), std::numeric_limits<Nanoseconds>::max()}) {
    EXPECT_EQ(parse_utc(format_utc(time)), time) << format_utc(time);
  }
  EXPECT_EQ(format_utc(std::numeric_limits<Nanoseconds>::min()), "1677-09-21T00:12:43.145224192Z");
}

TEST(Utc, EveryNanosecondComesBack) {
  EXPECT_TRUE(rc::check("format_utc then parse_utc", [] {
    const auto time = *rc::gen::arbitrary<Nanoseconds>();
    RC_ASSERT(parse_utc(format_utc(time)) == time);
  }));
}

class BadUtc : public ::testing::TestWithParam<const char*> {};

TEST_P(BadUtc, IsRefusedWithTheText) {
  try {
    parse_utc(GetParam());
    FAIL() << "accepted";
  } catch (const Error& error) {
    EXPECT_EQ(error.exit_code(), ExitCode::kBadInput);
    EXPECT_THAT(error.what(), ::testing::HasSubstr(GetParam()));
  }
}

INSTANTIATE_TEST_SUITE_P(
    Texts, BadUtc,
    ::testing::Values("", "now", "2026-01-01", "2026-01-01T00:00:00", "2026-01-01T00:00:00+00:00",
                      "2026-01-01 00:00:00Z", "2026-1-1T00:00:00Z", "2026-13-01T00:00:00Z",
                      "2026-00-01T00:00:00Z", "2026-02-29T00:00:00Z", "2026-01-01T24:00:00Z",
                      "2026-01-01T00:60:00Z", "2026-01-01T00:00:60Z", "2026-01-01T00:00:00.Z",
                      "2026-01-01T00:00:00.1234567890Z", "2026-01-01T00:00:00Zx",
                      "-026-01-01T00:00:00Z", "1677-09-21T00:12:43.145224191Z",
                      "2262-04-11T23:47:16.854775808Z", "0000-01-01T00:00:00Z",
                      "9999-12-31T23:59:59Z", "1600-01-01T00:00:00.5Z"));

}  // namespace
}  // namespace raystage
