// SPDX-License-Identifier: Apache-2.0
#include "schemas/validator.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <stdexcept>

#include "base/error.h"
#include "schemas/embedded_schemas.h"

namespace raystage::schemas {
namespace {

using nlohmann::json;
using ::testing::HasSubstr;
using ::testing::Not;

std::string verdict(const char* schema, const char* document) {
  try {
    SchemaValidator(json::parse(schema)).validate(json::parse(document), "f");
  } catch (const Error& error) {
    EXPECT_EQ(error.exit_code(), ExitCode::kBadInput);
    return error.what();
  }
  return "good";
}

TEST(Validator, OurSchemasSayNothingThatIsNotChecked) {
  EXPECT_EQ(embedded_schemas().size(), 25U);
  for (const EmbeddedSchema& schema : embedded_schemas()) {
    const json parsed = json::parse(schema.text);
    EXPECT_NO_THROW(SchemaValidator{parsed}) << schema.name;
    // "shot-1" is version 1 of a schema with three versions.
    const std::size_t dash = schema.name.find('-');
    const std::string kind(schema.name.substr(0, dash));
    const std::map<std::string, std::string> newest{
        {"shot", "3"}, {"rig", "2"}, {"import", "2"}, {"take", "2"}};
    const auto found = newest.find(kind);
    const std::string version(dash != std::string_view::npos ? schema.name.substr(dash + 1)
                              : found != newest.end()        ? std::string_view(found->second)
                                                             : std::string_view("1"));
    EXPECT_EQ(parsed.at("$id"), "raystage/" + kind + "/" + version);
  }
}

TEST(Validator, WhatSchemasShareIsTheSame) {
  json shared;
  for (const EmbeddedSchema& schema : embedded_schemas()) {
    if (schema.name.find('-') != std::string_view::npos) continue;  // an older version
    const json parsed = json::parse(schema.text);
    const json definitions = parsed.value("$defs", json::object());
    for (const auto& [name, definition] : definitions.items()) {
      EXPECT_EQ(shared.emplace(name, definition).first.value(), definition)
          << schema.name << " " << name;
    }
  }
}

TEST(Validator, EveryPropertyIsDescribed) {
  const std::function<void(const json&, const json&, const std::string&)> visit =
      [&](const json& root, const json& schema, const std::string& path) {
        if (!schema.contains("properties")) return;
        for (const auto& [name, property] : schema["properties"].items()) {
          const json& target =
              property.contains("$ref")
                  ? root.at(json::json_pointer(property["$ref"].get<std::string>().substr(1)))
                  : property;
          EXPECT_TRUE(property.contains("description") || target.contains("description") ||
                      property.contains("const") || property.contains("items"))
              << path << "/" << name;
          visit(root, target.contains("items") ? target["items"] : target, path + "/" + name);
        }
      };
  for (const EmbeddedSchema& schema : embedded_schemas()) {
    const json parsed = json::parse(schema.text);
    visit(parsed, parsed, std::string(schema.name));
  }
}

TEST(Validator, UnknownRulesAreRefused) {
  for (const char* schema :
       {R"({"multipleOf": 2})", R"({"properties": {"a": {"not": {}}}})",
        R"({"items": {"uniqueItems": true}})", R"({"$ref": "#/$defs/none", "$defs": {}})",
        R"({"additionalProperties": {"type": "null"}})", R"({"type": ["null", "number"]})",
        R"({"patternProperties": {"a.*": true}})", R"({"pattern": "a"})",
        R"({"type": "string", "maxLength": 9, "pattern": "^[a-z]+$"})", "true"}) {
    EXPECT_THROW(SchemaValidator{json::parse(schema)}, std::logic_error) << schema;
  }
}

struct Case {
  const char *schema, *good, *bad, *message;
};

class ValidatorCases : public ::testing::TestWithParam<Case> {};

TEST_P(ValidatorCases, AcceptsAndRefuses) {
  const Case& c = GetParam();
  EXPECT_EQ(verdict(c.schema, c.good), "good");
  const std::string message = verdict(c.schema, c.bad);
  EXPECT_THAT(message, HasSubstr(c.message));
  EXPECT_THAT(message, Not(HasSubstr("[a-z]"))) << "a regular expression";
}

INSTANTIATE_TEST_SUITE_P(
    Rules, ValidatorCases,
    ::testing::Values(
        Case{R"({"type": "number", "exclusiveMinimum": 0})", "0.1", R"("abc")",
             "f#: found \"abc\", allowed: a number greater than 0."},
        Case{R"({"type": "number", "exclusiveMinimum": 0})", "1e300", "0", "found 0, allowed"},
        Case{R"({"type": "number", "minimum": -1, "maximum": 1})", "-1", "1.0001",
             "a number from -1 up to 1"},
        Case{R"({"type": "number", "exclusiveMaximum": 180})", "179.9", "180", "less than 180"},
        Case{R"({"type": "integer"})", "2.0", "2.5", "an integer"},
        Case{R"({"type": "integer", "maximum": 9007199254740993})", "9007199254740993",
             "9007199254740994", "found 9007199254740994"},
        Case{R"({"type": "integer", "minimum": 0})", "18446744073709551615", "-1", "found -1"},
        Case{R"({"type": "string", "minLength": 1, "maxLength": 2})", R"("ab")", R"("abc")",
             "a string of 1 to 2 bytes"},
        Case{
            R"({"type": "string", "maxLength": 9, "pattern": "^[a-z]+$", "patternDescription": "letters"})",
            R"("ab")", R"("a1")", "a string of 0 to 9 bytes: letters."},
        Case{R"({"type": "boolean"})", "false", "0", "a boolean"},
        Case{R"({"type": "null"})", "null", "false", "allowed: null"},
        Case{R"({"const": "best"})", R"("best")", R"("worst")", "allowed: \"best\""},
        Case{R"({"enum": ["a", "b"]})", R"("b")", R"("c")", "allowed: \"a\" or \"b\""},
        Case{R"({"type": "array", "minItems": 2, "maxItems": 2})", "[0, 0]", "[0]",
             "found an array of 1, allowed: an array of 2"},
        Case{R"({"type": "array", "minItems": 1})", "[0]", "[]", "an array of at least 1"},
        Case{R"({"items": {"type": "object", "required": ["k"]}})", R"([{"k": 1}])",
             R"([{"k": 1}, {}])", "f#/1: the property \"k\" is missing"},
        Case{R"({"properties": {"a": {"type": "null"}}, "required": ["a"]})", R"({"a": null})",
             "{}", "missing, allowed there: null"},
        Case{R"({"properties": {"width": {}}, "additionalProperties": false})", R"({"width": 1})",
             R"({"widht": 1})",
             "f#/widht: found the unknown property \"widht\", perhaps \"width\""},
        Case{R"({"patternProperties": {"^x_": true}, "additionalProperties": false})",
             R"({"x_note": [1]})", R"({"y": 1})", "f#/y"},
        Case{R"({"$defs": {"n": {"type": "number"}}, "properties": {"a": {"$ref": "#/$defs/n"}}})",
             R"({"a": 1})", R"({"a": "1"})", "f#/a: found \"1\", allowed: a number"},
        Case{R"({"oneOf": [{"const": 1}, {"type": "object", "required": ["d"],
                 "properties": {"d": {"type": "number"}}}]})",
             R"({"d": 1})", R"({"d": "x"})", "f#/d: found \"x\", allowed: a number"},
        Case{R"({"oneOf": [{"const": 1}, {"type": "object", "required": ["d"]}]})", "1", "2",
             "found 2, allowed: 1 or an object with \"d\""},
        Case{R"({"oneOf": [{"type": "number"}, {"const": 1}]})", "2", "1", "found 1"},
        Case{R"({"anyOf": [{"const": 1}, {"maxLength": 9, "pattern": "^[a-z]+$",
                 "patternDescription": "lower-case letters"}]})",
             "1", R"("a1")", "allowed: 1 or anything: lower-case letters"},
        Case{R"({"anyOf": [{"type": "number"}, {"const": 1}]})", "1", "null",
             "allowed: a number or 1"}));

TEST(Validator, PointersAreEscaped) {
  EXPECT_THAT(verdict(R"({"properties": {"a/~": {"type": "null"}}})", R"({"a/~": 1})"),
              HasSubstr("f#/a~1~0:"));
}

/// Counts patterns. Fails for one without "patternDescription", or with a regular expression in it.
int patterns_in(const nlohmann::json& schema, std::string_view name) {
  int count = 0;
  if (schema.is_object() && schema.contains("pattern") && schema["pattern"].is_string()) {
    const std::string words = schema.value("patternDescription", "");
    EXPECT_GE(words.size(), 10U) << name << ": " << schema["pattern"];
    EXPECT_EQ(words.find_first_of("^$[]{}*+\\"), words.npos) << name << ": " << words;
    ++count;
  }
  if (schema.is_structured()) {
    for (const auto& child : schema) count += patterns_in(child, name);
  }
  return count;
}

TEST(Schemas, SayWhatTheirPatternsAllowInWords) {
  int patterns = 0;
  for (const EmbeddedSchema& schema : embedded_schemas()) {
    patterns += patterns_in(json::parse(schema.text), schema.name);
  }
  EXPECT_GE(patterns, 12);
}

}  // namespace
}  // namespace raystage::schemas
