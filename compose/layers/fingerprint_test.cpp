// SPDX-License-Identifier: Apache-2.0
#include "compose/layers/fingerprint.h"

#include <gtest/gtest.h>

#include <limits>
#include <set>

namespace raystage::compose {
namespace {

TEST(Fingerprint, IsTheSameForTheSameValues) {
  const auto make = [] {
    return Fingerprint().text("a", "x").integer("b", -1).number("c", 0.1).hex();
  };
  EXPECT_EQ(make(), make());
  EXPECT_EQ(make().size(), 32U);
}

TEST(Fingerprint, TellsEveryDifferenceApart) {
  std::set<std::string> prints;
  const auto add = [&](const Fingerprint& print) { prints.insert(print.hex()); };
  add(Fingerprint());
  add(Fingerprint().text("a", ""));
  add(Fingerprint().text("a", "bc").text("d", "e"));
  add(Fingerprint().text("a", "b").text("cd", "e"));
  add(Fingerprint().text("a", "b\nc:1:d"));
  add(Fingerprint().text("a", "b").text("c", "d"));
  add(Fingerprint().integer("a", 1));
  add(Fingerprint().integer("a", -1));
  add(Fingerprint().number("a", 1));
  add(Fingerprint().number("a", 1 + std::numeric_limits<double>::epsilon()));
  EXPECT_EQ(prints.size(), 10U);
  EXPECT_EQ(Fingerprint().number("a", 0.0).hex(), Fingerprint().number("a", -0.0).hex());
}

TEST(Fingerprint, ACopyGoesOnAlone) {
  Fingerprint common;
  common.text("a", "b");
  Fingerprint one(common), two(common);
  EXPECT_NE(one.integer("f", 1).hex(), two.integer("f", 2).hex());
  EXPECT_EQ(Fingerprint().text("a", "b").hex(), common.hex());
}

}  // namespace
}  // namespace raystage::compose
