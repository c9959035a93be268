// SPDX-License-Identifier: Apache-2.0
#include "base/printable.h"

#include <gtest/gtest.h>

#include <string>

#include "base/error.h"

namespace raystage {
namespace {

TEST(Printable, NamesCannotControlTheTerminal) {
  EXPECT_EQ(printable("a\tb\nc"), "a\tb\nc");
  EXPECT_EQ(printable("\x1b]0;owned\x07"), "\\u001b]0;owned\\u0007");
  EXPECT_EQ(printable("take\r\x7f"), "take\\u000d\\u007f");
  EXPECT_EQ(printable("\xC2\x9B"
                      "31m"),
            "\\u009b31m");  // CSI as one character
  EXPECT_EQ(printable("caf\xC3\xA9 \xE4\xB8\xAD"), "caf\xC3\xA9 \xE4\xB8\xAD");
  EXPECT_EQ(printable("\xC2"), "\xC2");
  EXPECT_EQ(printable("\x9B"
                      "31m"),
            "\\u009b31m");  // the same on terminals of 8 bits
  EXPECT_EQ(printable("\xE4\x9B"
                      "31m\xC2"),
            "\xE4\\u009b31m\xC2");  // no character in UTF-8
  EXPECT_EQ(printable("\xE9\xFF\xF5\x80\x80\x80"), "\xE9\xFF\xF5\\u0080\\u0080\\u0080");
  EXPECT_EQ(printable("\xF0\x9F\x8E\xA5"), "\xF0\x9F\x8E\xA5");
  // Longer than necessary, a surrogate, and beyond U+10FFFF.
  EXPECT_EQ(printable("\xE0\x82\x9B"), "\xE0\\u0082\\u009b");
  EXPECT_EQ(printable("\xF0\x80\x82\x9B"), "\xF0\\u0080\\u0082\\u009b");
  EXPECT_EQ(printable("\xED\xA0\x80"), "\xED\xA0\\u0080");
  EXPECT_EQ(printable("\xF4\x90\x80\x80"), "\xF4\\u0090\\u0080\\u0080");
}

TEST(Printable, ErrorsDoNotEndAtANulCharacter) {
  const Error error = Error::bad_input("not found", std::string("a\0b", 3), "Look elsewhere");
  EXPECT_STREQ(error.what(), "a\\u0000b: not found. Look elsewhere.");
}

TEST(Printable, NamesCannotLookLikeLinesOfAReport) {
  EXPECT_EQ(printable_in_line("a\tb\nc\x1b"), "a\\u0009b\\u000ac\\u001b");
}

}  // namespace
}  // namespace raystage
