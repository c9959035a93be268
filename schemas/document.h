// SPDX-License-Identifier: Apache-2.0
// Internal to schemas/: helpers shared by the typed documents.
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <string>
#include <string_view>

#include "base/time.h"
#include "schemas/geometry.h"
#include "schemas/json_text.h"
#include "schemas/option_values.h"
#include "schemas/photometric_response.h"

namespace raystage::schemas {

/// A JSON value with its JSON pointer in a document.
struct JsonNode {
  const nlohmann::json& value;
  std::string_view name;  ///< of the document
  std::string pointer;

  JsonNode at(std::string_view key) const;
  JsonNode at(std::size_t index) const;
  bool has(std::string_view key) const { return value.contains(std::string(key)); }
  std::size_t size() const { return value.size(); }

  template <typename T>
  T get() const {
    return value.get<T>();
  }
  /// Returns Error (bad input) at this value.
  Error input_error(std::string what_happened, std::string what_to_do) const {
    return json_value_error(name, pointer, std::move(what_happened), std::move(what_to_do));
  }
};

struct VersionedDocument {
  nlohmann::json json;
  int version = 1;
};
/// Parses a document of schema "raystage/KIND/VERSION", any version up to the newest, and validates
/// it against that schema. Throws Error (bad input).
VersionedDocument parse_versioned_document(std::string_view kind, std::string_view text,
                                           std::string_view name);
/// Returns the JSON of parse_versioned_document() for a kind with a single version.
nlohmann::json parse_document(std::string_view kind, std::string_view text, std::string_view name);

/// Returns an object whose first member is the schema's name and version; nullopt: the newest.
nlohmann::ordered_json make_document(std::string_view kind, std::optional<int> version = {});

/// Returns the object's id and adds it to `seen`. Throws Error (bad input) if `seen` contains it.
std::string unique_id_from(const JsonNode& object, std::set<std::string, std::less<>>& seen);
/// Returns a path. Throws Error (bad input) if it contains control characters.
std::string path_from(const JsonNode& text);
/// Returns a relative path. Throws Error (bad input) if it leaves its folder.
std::string relative_path_from(const JsonNode& text);
/// Returns a time since 1970. Throws Error (bad input) at `text` if parse_utc() does.
Nanoseconds utc_from(const JsonNode& text);

DepthRange depth_range_from(const JsonNode& range);
nlohmann::ordered_json json_from(const DepthRange& range);

/// Reads id, size, intrinsics, pose, row and column. Throws Error (bad input) for a non-rigid pose.
CameraGeometry camera_from(const JsonNode& object);
/// Returns whether the camera is a pinhole with a global shutter. Version 1 of rigs and import
/// manifests has no others; documents without others are written in it, for older programs.
bool is_plain_camera(const CameraGeometry& camera);
nlohmann::ordered_json json_from(const CameraGeometry& camera);

/// Reads a camera's photometric response. Throws Error (bad input) for a curve that does not
/// increase, a gain that is not positive, or hot pixels that are unsorted or outside the picture.
PhotometricResponse photometric_from(const JsonNode& object, const CameraGeometry& camera);
nlohmann::ordered_json json_from(const PhotometricResponse& response);

/// Returns the numbers, strings and booleans by name, without remarks ("x_...", "comment").
OptionValues options_from(const JsonNode& object);
nlohmann::ordered_json json_from(const OptionValues& options);

}  // namespace raystage::schemas
