// SPDX-License-Identifier: Apache-2.0
#include "base/base64.h"

#include <gtest/gtest.h>
#include <rapidcheck.h>

namespace raystage {
namespace {

std::string encoded(std::string_view text) {
  return encode_base64(std::as_bytes(std::span(text.data(), text.size())));
}

TEST(Base64, IsTheStandardsOwn) {
  EXPECT_EQ(encoded(""), "");
  EXPECT_EQ(encoded("f"), "Zg==");
  EXPECT_EQ(encoded("fo"), "Zm8=");
  EXPECT_EQ(encoded("foo"), "Zm9v");
  EXPECT_EQ(encoded("foobar"), "Zm9vYmFy");
}

TEST(Base64, ComesBack) {
  EXPECT_TRUE(rc::check(
      [](const std::string& bytes) { RC_ASSERT(decode_base64(encoded(bytes)) == bytes); }));
  EXPECT_EQ(decode_base64("Zm8"), "fo");
}

TEST(Base64, RefusesOtherText) {
  for (const char* text : {"Z", "Zm9vY", "Zm 9", "Zm9-", "Zg===", "=Zg"}) {
    EXPECT_FALSE(decode_base64(text).has_value()) << text;
  }
}

}  // namespace
}  // namespace raystage
