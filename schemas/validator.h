// SPDX-License-Identifier: Apache-2.0
// Include in .cpp files only: nlohmann's types take a second to compile.
#pragma once

#include <map>
#include <nlohmann/json.hpp>
#include <regex>
#include <string>
#include <string_view>

namespace raystage::schemas {

/// Validates documents with a subset of JSON Schema, draft 2020-12. Keywords: type, const, enum,
/// minimum, exclusiveMinimum, maximum, exclusiveMaximum, minLength, maxLength (bytes), pattern,
/// items, minItems, maxItems, properties, patternProperties ("^prefix" only, any value),
/// additionalProperties (false only), required, oneOf, anyOf and $ref to "#/$defs/NAME". Our own
/// keywords: "patternDescription" (a pattern in words) and "formerly" (former_names.h). Messages
/// state a pattern in the words of "patternDescription", never as a regular expression.
class SchemaValidator {
 public:
  /// Throws std::logic_error for any other keyword, so that no rule is silently ignored.
  explicit SchemaValidator(nlohmann::json schema);

  /// Throws Error (bad input) at "NAME#/json/pointer" with the value found and the values allowed.
  void validate(const nlohmann::json& document, std::string_view name) const;
  const nlohmann::json& schema() const { return schema_; }

 private:
  struct Place {
    std::string_view name;
    std::string pointer;
  };
  using Json = nlohmann::json;

  void adopt(const Json& schema);
  void check(const Json& schema, const Json& value, const Place& place) const;
  void check_plain(const Json& schema, const Json& value, const Place& place) const;
  void check_array(const Json& schema, const Json& value, const Place& place) const;
  void check_object(const Json& schema, const Json& value, const Place& place) const;
  void check_choice(const Json& schema, const Json& branches, bool exactly_one, const Json& value,
                    const Place& place) const;
  bool within_bounds(const Json& schema, const Json& value) const;
  const Json& resolve(const Json& schema) const;
  std::string allowed(const Json& schema) const;

  Json schema_;
  std::map<std::string, std::regex, std::less<>> patterns_;
};

}  // namespace raystage::schemas
