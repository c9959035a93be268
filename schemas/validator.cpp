// SPDX-License-Identifier: Apache-2.0
// Validates a document by walking it along its schema. All branches of oneOf and anyOf are tried.
// If none accepts the value, the error is that of the branch whose fault is deepest in the
// document, unless that is an unknown property. Input: JSON; output: nothing, or an Error at a JSON
// pointer. Cost: linear in the document, times the branches.
#include "schemas/validator.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>
#include <stdexcept>
#include <utility>
#include <vector>

#include "schemas/json_text.h"

namespace raystage::schemas {
namespace {

using nlohmann::json;

constexpr std::string_view kDefinitions = "#/$defs/";
constexpr std::string_view kUnderstood[] = {"$schema",
                                            "$id",
                                            "$defs",
                                            "$ref",
                                            "title",
                                            "type",
                                            "description",
                                            "const",
                                            "enum",
                                            "minimum",
                                            "maximum",
                                            "exclusiveMinimum",
                                            "minLength",
                                            "maxLength",
                                            "pattern",
                                            "patternDescription",
                                            "formerly",
                                            "exclusiveMaximum",
                                            "items",
                                            "minItems",
                                            "maxItems",
                                            "properties",
                                            "required",
                                            "oneOf",
                                            "anyOf",
                                            "patternProperties",
                                            "additionalProperties"};
// std::regex recurses once per character: maxLength rejects longer text first.
constexpr int kLongestForPattern = 1000;

bool is_integer(const json& value) {
  if (value.is_number_integer()) return true;
  constexpr double kExact = 9007199254740992;  // 2^53
  return value.is_number_float() && std::trunc(value.get<double>()) == value.get<double>() &&
         std::abs(value.get<double>()) <= kExact;
}

bool has_type(const json& value, std::string_view type) {
  if (type == "object") return value.is_object();
  if (type == "array") return value.is_array();
  if (type == "string") return value.is_string();
  if (type == "number") return value.is_number() && std::isfinite(value.get<double>());
  if (type == "integer") return is_integer(value);
  if (type == "boolean") return value.is_boolean();
  return value.is_null();
}

std::string with_article(std::string_view type) {
  if (type == "null" || type == "anything") return std::string(type);
  const bool vowel = type.find_first_of("aeio") == 0;
  return fmt::format("{} {}", vowel ? "an" : "a", type);
}

std::size_t edit_distance(std::string_view a, std::string_view b) {
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), std::size_t{0});
  for (std::size_t i = 0; i < a.size(); ++i) {
    std::size_t diagonal = std::exchange(row[0], i + 1);
    for (std::size_t j = 0; j < b.size(); ++j) {
      const std::size_t substituted = diagonal + (a[i] == b[j] ? 0 : 1);
      diagonal = row[j + 1];
      row[j + 1] = std::min({substituted, row[j] + 1, row[j + 1] + 1});
    }
  }
  return row.back();
}

std::string unknown_property(std::string_view key, const json& properties) {
  std::vector<std::string> names;
  for (const auto& [name, ignored] : properties.items()) names.push_back(name);
  constexpr std::size_t kLongestKey = 64;  // a longer key is not a typing error
  std::string guess;
  std::size_t best = 3;
  for (const std::string& name : names) {
    if (key.size() > kLongestKey) break;
    const std::size_t distance = edit_distance(key, name);
    if (distance < best && distance < name.size()) {
      best = distance;
      guess = fmt::format(", perhaps \"{}\" is meant", name);
    }
  }
  return fmt::format("found the unknown property {}{}; allowed: \"{}\"",
                     describe_json_value(json(key)), guess, fmt::join(names, "\", \""));
}

}  // namespace

SchemaValidator::SchemaValidator(nlohmann::json schema) : schema_(std::move(schema)) {
  adopt(schema_);
}

void SchemaValidator::adopt(const Json& schema) {
  if (!schema.is_object()) throw std::logic_error("schema: a schema must be an object");
  for (const auto& [keyword, rule] : schema.items()) {
    if (std::find(std::begin(kUnderstood), std::end(kUnderstood), keyword) ==
        std::end(kUnderstood)) {
      throw std::logic_error("schema: the keyword is not supported: " + keyword);
    }
    if (keyword == "$defs" || keyword == "properties") {
      for (const auto& [name, child] : rule.items()) adopt(child);
    } else if (keyword == "items") {
      adopt(rule);
    } else if (keyword == "oneOf" || keyword == "anyOf") {
      for (const Json& child : rule) adopt(child);
    } else if (keyword == "$ref") {
      const auto target = rule.get<std::string>();
      if (!target.starts_with(kDefinitions) ||
          !schema_.at("$defs").contains(target.substr(kDefinitions.size()))) {
        throw std::logic_error("schema: the definition does not exist: " + target);
      }
    } else if (keyword == "pattern") {
      if (schema.value("maxLength", kLongestForPattern + 1) > kLongestForPattern) {
        throw std::logic_error("schema: a pattern needs a maxLength of at most 1000");
      }
      if (!schema.contains("patternDescription")) {
        throw std::logic_error("schema: a pattern needs a patternDescription for the user");
      }
      patterns_.try_emplace(rule.get<std::string>(), rule.get<std::string>());
    } else if (keyword == "additionalProperties" && rule != Json(false)) {
      throw std::logic_error("schema: additionalProperties may only be false");
    } else if (keyword == "patternProperties") {
      for (const auto& [pattern, child] : rule.items()) {
        if (!pattern.starts_with('^') ||
            pattern.find_first_of("\\.[](){}*+?|$^", 1) != pattern.npos || child != Json(true)) {
          throw std::logic_error("schema: patternProperties may only be \"^prefix\": true");
        }
      }
    } else if (keyword == "type" && !rule.is_string()) {
      throw std::logic_error("schema: type may only be one name");
    }
  }
}

void SchemaValidator::validate(const nlohmann::json& document, std::string_view name) const {
  check(schema_, document, {name, ""});
}

const SchemaValidator::Json& SchemaValidator::resolve(const Json& schema) const {
  const Json* at = &schema;
  while (at->contains("$ref")) {
    at = &schema_.at("$defs").at(
        at->at("$ref").get_ref<const std::string&>().substr(kDefinitions.size()));
  }
  return *at;
}

void SchemaValidator::check(const Json& unresolved, const Json& value, const Place& place) const {
  const Json& schema = resolve(unresolved);
  check_plain(schema, value, place);
  if (value.is_array()) check_array(schema, value, place);
  if (value.is_object()) check_object(schema, value, place);
  if (const auto rule = schema.find("anyOf"); rule != schema.end()) {
    check_choice(schema, *rule, false, value, place);
  }
  if (const auto rule = schema.find("oneOf"); rule != schema.end()) {
    check_choice(schema, *rule, true, value, place);
  }
}

bool SchemaValidator::within_bounds(const Json& schema, const Json& value) const {
  const auto holds = [&](const char* keyword, const auto& test) {
    const auto rule = schema.find(keyword);
    return rule == schema.end() || test(*rule);
  };
  if (value.is_number()) {
    // nlohmann compares integers as integers: exact up to 64 bits.
    return holds("minimum", [&](const Json& bound) { return value >= bound; }) &&
           holds("maximum", [&](const Json& bound) { return value <= bound; }) &&
           holds("exclusiveMinimum", [&](const Json& bound) { return value > bound; }) &&
           holds("exclusiveMaximum", [&](const Json& bound) { return value < bound; });
  }
  if (value.is_string()) {
    const auto& text = value.get_ref<const std::string&>();
    return holds("minLength", [&](const Json& bound) { return text.size() >= bound; }) &&
           holds("maxLength", [&](const Json& bound) { return text.size() <= bound; }) &&
           holds("pattern", [&](const Json& pattern) {
             return std::regex_search(
                 text, patterns_.find(pattern.get_ref<const std::string&>())->second);
           });
  }
  if (value.is_array()) {
    return holds("minItems", [&](const Json& bound) { return value.size() >= bound; }) &&
           holds("maxItems", [&](const Json& bound) { return value.size() <= bound; });
  }
  return true;
}

void SchemaValidator::check_plain(const Json& schema, const Json& value, const Place& place) const {
  bool good = within_bounds(schema, value);
  if (const auto rule = schema.find("type"); rule != schema.end()) {
    good = good && has_type(value, rule->get_ref<const std::string&>());
  }
  if (const auto rule = schema.find("const"); rule != schema.end()) good = good && value == *rule;
  if (const auto rule = schema.find("enum"); rule != schema.end()) {
    good = good && std::find(rule->begin(), rule->end(), value) != rule->end();
  }
  if (good) return;
  throw json_value_error(
      place.name, place.pointer,
      fmt::format("found {}, allowed: {}", describe_json_value(value), allowed(schema)),
      "Correct the value");
}

void SchemaValidator::check_array(const Json& schema, const Json& value, const Place& place) const {
  const auto items = schema.find("items");
  if (items == schema.end()) return;
  for (std::size_t i = 0; i < value.size(); ++i) {
    check(*items, value[i], {place.name, append_json_pointer(place.pointer, i)});
  }
}

void SchemaValidator::check_object(const Json& schema, const Json& value,
                                   const Place& place) const {
  const auto rules = schema.find("properties");
  const Json none = Json::object();
  const Json& properties = rules == schema.end() ? none : *rules;
  if (const auto rule = schema.find("required"); rule != schema.end()) {
    for (const Json& entry : *rule) {
      const auto& key = entry.get_ref<const std::string&>();
      if (value.contains(key)) continue;
      const auto property = properties.find(key);
      throw json_value_error(
          place.name, place.pointer,
          fmt::format("the property \"{}\" is missing, allowed there: {}", key,
                      property == properties.end() ? "anything" : allowed(*property)),
          "Add it");
    }
  }
  const auto prefixes = schema.find("patternProperties");
  for (const auto& [key, child] : value.items()) {
    if (const auto property = properties.find(key); property != properties.end()) {
      check(*property, child, {place.name, append_json_pointer(place.pointer, key)});
      continue;
    }
    bool free = !schema.contains("additionalProperties");
    if (prefixes != schema.end()) {
      for (const auto& [pattern, ignored] : prefixes->items()) {
        free = free || key.starts_with(std::string_view(pattern).substr(1));
      }
    }
    if (free) continue;
    throw json_value_error(place.name, append_json_pointer(place.pointer, key),
                           unknown_property(key, properties),
                           "Remove it, or begin the name of a remark with \"x_\" or \"comment\"");
  }
}

void SchemaValidator::check_choice(const Json& schema, const Json& branches, bool exactly_one,
                                   const Json& value, const Place& place) const {
  int matches = 0;
  std::optional<Error> nearest;  // of the branch that accepts the value except for a part of it
  for (const Json& branch : branches) {
    try {
      check(branch, value, place);
      ++matches;
    } catch (const Error& error) {
      const std::size_t here = place.name.size() + 1 + place.pointer.size();
      const std::size_t depth = nearest ? nearest->where().size() : here;
      if (error.where().size() > depth) nearest = error;
    }
  }
  if (exactly_one ? matches == 1 : matches > 0) return;
  // The pointer of an unknown property is deeper, but does not show which branch was meant.
  if (matches == 0 && nearest &&
      nearest->what_happened().find("unknown property") == std::string::npos) {
    throw Error(*nearest);
  }
  throw json_value_error(
      place.name, place.pointer,
      fmt::format("found {}, allowed: {}", describe_json_value(value), allowed(schema)),
      "Correct the value");
}

std::string SchemaValidator::allowed(const Json& unresolved) const {
  const Json& schema = resolve(unresolved);
  const auto list = [](const Json& values, std::string_view separator, const auto& text) {
    std::vector<std::string> parts;
    for (const Json& value : values) parts.push_back(text(value));
    return fmt::format("{}", fmt::join(parts, separator));
  };
  if (schema.contains("const")) return schema["const"].dump();
  if (schema.contains("enum")) {
    return list(schema["enum"], " or ", [](const Json& value) { return value.dump(); });
  }
  for (const char* choice : {"oneOf", "anyOf"}) {
    if (!schema.contains(choice)) continue;
    return list(schema[choice], " or ", [&](const Json& branch) { return allowed(branch); });
  }
  const auto type = schema.value("type", std::string("anything"));
  std::string text = with_article(type);
  const auto append = [&](const char* keyword, std::string_view words) {
    if (schema.contains(keyword)) text += fmt::format(" {} {}", words, schema[keyword].dump());
  };
  append("minimum", "from");
  append("exclusiveMinimum", "greater than");
  append("maximum", "up to");
  append("exclusiveMaximum", "less than");
  if (type == "string" && schema.contains("maxLength")) {
    text +=
        fmt::format(" of {} to {} bytes", schema.value("minLength", 0), schema["maxLength"].dump());
  }
  if (schema.contains("patternDescription")) {
    text += ": " + schema["patternDescription"].get<std::string>();
  }
  if (type == "array") {
    const int least = schema.value("minItems", 0);
    const int most = schema.value("maxItems", -1);
    text += most < 0        ? fmt::format(" of at least {}", least)
            : most == least ? fmt::format(" of {}", least)
                            : fmt::format(" of {} to {}", least, most);
    if (schema.contains("items")) text += fmt::format(", each {}", allowed(schema["items"]));
  }
  if (type == "object" && schema.contains("required") && !schema["required"].empty()) {
    text += fmt::format(" with {}",
                        list(schema["required"], ", ", [](const Json& v) { return v.dump(); }));
  }
  return text;
}

}  // namespace raystage::schemas
