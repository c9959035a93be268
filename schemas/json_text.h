// SPDX-License-Identifier: Apache-2.0
// For .cpp files only: shows nlohmann's types, which take a second to compile.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <string_view>

#include "base/error.h"

namespace raystage {

/// Parses strict JSON. Throws Error (bad input): syntax with "NAME:line:column"; a key that comes
/// twice, a number too large for a double, and nesting deeper than 64 likewise.
nlohmann::json parse_json(std::string_view text, std::string_view name);

/// Human-readable JSON: two spaces of indent; arrays and objects of plain values on one line where
/// they fit into 100 columns, so that a matrix has a row per line. Doubles come back exactly.
std::string format_json(const nlohmann::ordered_json& value);

/// `pointer` extended by one step (RFC 6901).
std::string append_json_pointer(std::string_view pointer, std::string_view key);
std::string append_json_pointer(std::string_view pointer, std::size_t index);

/// Bad input at "NAME#POINTER".
Error json_value_error(std::string_view name, std::string_view pointer, std::string what_happened,
                       std::string what_to_do);

/// What stands in a document, short enough for a message.
std::string found(const nlohmann::json& value);

}  // namespace raystage
