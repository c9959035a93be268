// SPDX-License-Identifier: Apache-2.0
// Include in .cpp files only: nlohmann's types take a second to compile.
#pragma once

#include <cmath>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>

#include "base/error.h"

namespace raystage::schemas {

/// Parses strict JSON. Throws Error (bad input) for a syntax error (at "NAME:line:column"), a
/// duplicate key, a number too large for a double, or nesting deeper than 64.
nlohmann::json parse_json(std::string_view text, std::string_view name);

/// Returns JSON indented by two spaces; doubles round-trip exactly. Arrays and objects of plain
/// values are on one line if they fit into 100 columns: a matrix has one row per line.
std::string format_json(const nlohmann::ordered_json& value);

/// Returns JSON for other programs, in one line where `indent` is negative. What is not UTF-8, such
/// as names of files may be, becomes U+FFFD.
inline std::string dump_json(const nlohmann::ordered_json& value, int indent = 2) {
  return value.dump(indent, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
}

/// Returns a number, or null if it is not finite: JSON has no infinity.
inline nlohmann::ordered_json number_or_null(double value) {
  return std::isfinite(value) ? nlohmann::ordered_json(value) : nlohmann::ordered_json(nullptr);
}

/// Returns `pointer` extended by one reference token (RFC 6901).
std::string append_json_pointer(std::string_view pointer, std::string_view key);
std::string append_json_pointer(std::string_view pointer, std::size_t index);

/// Returns Error (bad input) at "NAME#POINTER".
Error json_value_error(std::string_view name, std::string_view pointer, std::string what_happened,
                       std::string what_to_do);

/// Returns a description of a value that is short enough for an error message.
std::string describe_json_value(const nlohmann::json& value);

}  // namespace raystage::schemas
