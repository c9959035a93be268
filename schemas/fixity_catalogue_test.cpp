// SPDX-License-Identifier: Apache-2.0
#include "schemas/fixity_catalogue.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"

namespace raystage::schemas {
namespace {

FixityCatalogue filled_catalogue() {
  FixityCatalogue catalogue;
  FixityCatalogue::Take take;
  take.path = "2026/stage";
  take.name = "stage";
  take.first_seen_utc = 1'767'225'600 * kNanosecondsPerSecond;
  catalogue.takes.push_back(take);
  take.path = "2026/b";
  take.missing_since_utc = take.first_seen_utc + 1;
  take.last_intact_utc = take.first_seen_utc + 2;
  take.last_check = {take.first_seen_utc + 3,
                     "0123456789abcdef",
                     FixityCatalogue::Result::kDamaged,
                     2,
                     {"a: b", "c: d"},
                     1'000'000'000'000,
                     12.5};
  take.progress = {
      take.first_seen_utc + 4, "fedcba9876543210", {{"c0", 7, true}, {"c1", 3, false}}};
  catalogue.takes.push_back(take);
  return catalogue;
}

TEST(FixityCatalogue, ComesBackTheSame) {
  const std::string once = format_fixity_catalogue(filled_catalogue());
  const FixityCatalogue again = parse_fixity_catalogue(once, "f");
  EXPECT_EQ(format_fixity_catalogue(again), once);
  ASSERT_EQ(again.takes.size(), 2U);
  EXPECT_FALSE(again.takes[0].last_check);
  EXPECT_EQ(again.takes[1].last_check->result, FixityCatalogue::Result::kDamaged);
  EXPECT_EQ(again.takes[1].progress->cameras[1].frames, 3);
  EXPECT_EQ(again.takes[1].missing_since_utc, filled_catalogue().takes[1].missing_since_utc);
}

TEST(FixityCatalogue, WhatIsNotValidIsRefused) {
  const std::string good = format_fixity_catalogue(filled_catalogue());
  const auto refused = [&](const std::string& from, const std::string& to) {
    std::string text = good;
    const std::size_t at = text.find(from);
    ASSERT_NE(at, std::string::npos) << from;
    text.replace(at, from.size(), to);
    EXPECT_THROW(parse_fixity_catalogue(text, "f"), Error) << to;
  };
  refused("fixity_catalogue/1", "fixity_catalogue/2");
  refused("\"damaged\"", "\"fine\"");
  refused("\"2026/b\"", "\"2026/stage\"");  // the same take twice
  refused("2026-01-01T00:00:00Z", "2026-31-01T00:00:00Z");
  refused("\"frames\": 7", "\"frames\": -7");
  refused("\"takes\"", "\"take\"");
}

}  // namespace
}  // namespace raystage::schemas
