// SPDX-License-Identifier: Apache-2.0
#include "schemas/utf8_text.h"

#include <gtest/gtest.h>

#include <iterator>
#include <string>

namespace raystage::schemas {
namespace {

constexpr const char* kReplacement = "\xEF\xBF\xBD";  // U+FFFD

TEST(Utf8Text, ReplacesWhatIsNoUtf8) {
  EXPECT_EQ(utf8_text("caf\xC3\xA9\n", 100), "caf\xC3\xA9\n");
  EXPECT_EQ(utf8_text("a\xFFz", 100), std::string("a") + kReplacement + "z");
  EXPECT_EQ(utf8_text("cut\xC3", 100), std::string("cut") + kReplacement);
  EXPECT_TRUE(is_utf8("caf\xC3\xA9"));
  EXPECT_TRUE(is_utf8(""));
  EXPECT_FALSE(is_utf8("a\xFFz"));
  EXPECT_FALSE(is_utf8("cut\xC3"));
}

TEST(Utf8Text, CutsNoCharacter) {
  const std::string text = "\xC3\xA9\xE2\x82\xAC!";  // 2, 3 and 1 bytes
  const std::size_t kept[] = {0, 0, 2, 2, 2, 5, 6, 6};
  for (std::size_t most = 0; most < std::size(kept); ++most) {
    EXPECT_EQ(utf8_text(text, most), text.substr(0, kept[most])) << most;
  }
  // A replacement is longer than what it replaces, and not cut either.
  EXPECT_EQ(utf8_text("ab\xFF", 4), "ab");
}

}  // namespace
}  // namespace raystage::schemas
