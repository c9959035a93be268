// SPDX-License-Identifier: Apache-2.0
// Include in .cpp files only: nlohmann's types take a second to compile.
#pragma once

#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <string_view>

namespace raystage::schemas {

/// Renames the properties of a document that have a former name: those that `schema` lists under
/// "formerly" of a property, e.g. "hot_pixels": {"formerly": ["dark_pixels"], ...}. Former names
/// are deprecated aliases: documents with them stay valid. Throws Error (bad input) for an object
/// with both names.
void replace_former_names(const nlohmann::json& schema, nlohmann::json& document,
                          std::string_view name);

/// A member of a report, and the deprecated alias that is written next to it.
struct FormerName {
  std::string_view name, former;
};

/// Adds the former names of members to a report, in all of its objects.
template <typename Json>
void add_former_names(Json& report, std::span<const FormerName> names) {
  if (report.is_array() || report.is_object()) {
    for (Json& member : report) add_former_names(member, names);
  }
  if (!report.is_object()) return;
  for (const FormerName& renamed : names) {
    const auto member = report.find(std::string(renamed.name));
    if (member == report.end()) continue;
    Json value = *member;
    report[std::string(renamed.former)] = std::move(value);
  }
}

}  // namespace raystage::schemas
