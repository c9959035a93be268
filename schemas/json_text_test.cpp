// SPDX-License-Identifier: Apache-2.0
#include "schemas/json_text.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rapidcheck.h>

#include <bit>
#include <cmath>

namespace raystage::schemas {
namespace {

using ::testing::HasSubstr;

std::string refusal(std::string_view text) {
  try {
    parse_json(text, "a.json");
  } catch (const Error& error) {
    EXPECT_EQ(error.exit_code(), ExitCode::kBadInput);
    return error.what();
  }
  return "accepted";
}

TEST(JsonText, ReadsWhatNlohmannReads) {
  const std::string text =
      R"( {"a": [1, -2, 2.5, 18446744073709551615, true, null, "x\u00e9\n"], "b": {"": {}}, "c": []} )";
  EXPECT_EQ(parse_json(text, ""), nlohmann::json::parse(text));
  EXPECT_EQ(parse_json("7", ""), 7);
}

TEST(JsonText, SyntaxErrorsSayLineAndColumn) {
  EXPECT_THAT(refusal("{\n  \"a\": 1,\n  \"b\": nope\n}"), HasSubstr("a.json:3:9"));
  EXPECT_THAT(refusal("{\n  \"a\": NaN}"), HasSubstr("a.json:2:8"));
  EXPECT_THAT(refusal(""), HasSubstr("a.json:1:1"));
  EXPECT_THAT(refusal("{"), HasSubstr("a.json:1:"));
  EXPECT_THAT(refusal("[1] 2"), HasSubstr("a.json:1:5"));
  EXPECT_THAT(refusal("{\"a\": 1,}"), HasSubstr("a.json:1:"));
  EXPECT_THAT(refusal("\"\xff\""), HasSubstr("a.json:1:2"));
  EXPECT_THAT(refusal("// remark\n1"), HasSubstr("a.json:1:1"));
}

TEST(JsonText, NumbersBeyondDoubleAreRefused) {
  EXPECT_THAT(refusal("[0,\n1e999]"), HasSubstr("a.json:2:"));
  EXPECT_THAT(refusal("[1e999]"), HasSubstr("overflow"));
  EXPECT_THAT(refusal("[Infinity]"), HasSubstr("a.json:1:2"));
}

TEST(JsonText, RepeatedKeysAreRefused) {
  EXPECT_THAT(refusal(R"([0, {"a/b": {"k": 1, "k": 2}}])"), HasSubstr("a.json#/1/a~1b/k"));
}

TEST(JsonText, DeepNestingIsRefused) {
  EXPECT_THAT(refusal(std::string(100'000, '[')), HasSubstr("nested deeper than 64"));
}

TEST(JsonText, FormatKeepsEveryDouble) {
  EXPECT_TRUE(rc::check("format_json then parse_json", [] {
    const auto bits = *rc::gen::arbitrary<std::uint64_t>();
    const auto value = std::bit_cast<double>(bits);
    RC_PRE(std::isfinite(value));
    const auto read = parse_json(format_json(value), "").get<double>();
    RC_ASSERT(std::bit_cast<std::uint64_t>(read) == bits);
  }));
}

TEST(JsonText, FormatPutsPlainListsOnOneLine) {
  const nlohmann::ordered_json value{{"z", {{1.0, 0.0}, {0.0, 1.0}}},
                                     {"a", {{"k", "v"}, {"n", nullptr}}},
                                     {"e", nlohmann::ordered_json::array()}};
  EXPECT_EQ(format_json(value),
            "{\n"
            "  \"z\": [\n"
            "    [1.0, 0.0],\n"
            "    [0.0, 1.0]\n"
            "  ],\n"
            "  \"a\": {\"k\": \"v\", \"n\": null},\n"
            "  \"e\": []\n"
            "}\n");
}

TEST(JsonText, FormatBreaksLongLists) {
  nlohmann::ordered_json value;
  value["list"] = std::vector<int>(60, 1000);
  const std::string text = format_json(value);
  EXPECT_THAT(text, HasSubstr("    1000,\n"));
  EXPECT_EQ(parse_json(text, "")["list"].size(), 60u);
}

TEST(JsonText, FoundIsShort) {
  EXPECT_EQ(describe_json_value("abc"), "\"abc\"");
  EXPECT_EQ(describe_json_value(std::vector<int>{1, 2}), "an array of 2");
  EXPECT_LE(describe_json_value(std::string(1000, 'x')).size(), 90u);
}

}  // namespace
}  // namespace raystage::schemas
