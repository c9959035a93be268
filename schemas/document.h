// SPDX-License-Identifier: Apache-2.0
// Inside schemas/ only: what the typed documents share.
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

namespace raystage {

/// A JSON value in a document, and where it stands.
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
  template <typename T>
  T get(std::string_view key, T otherwise) const {
    return has(key) ? at(key).get<T>() : otherwise;
  }
  /// None where there is no such property.
  template <typename T>
  std::optional<T> get_if(std::string_view key) const {
    if (!has(key)) return std::nullopt;
    return at(key).get<T>();
  }
  /// Bad input here.
  Error input_error(std::string what_happened, std::string what_to_do) const {
    return json_value_error(name, pointer, std::move(what_happened), std::move(what_to_do));
  }
};

struct VersionedDocument {
  nlohmann::json json;
  int version = 1;
};
/// Parses a document of schema "raystage/KIND/VERSION", of any version up to the newest, and holds
/// it to that schema. Throws Error.
VersionedDocument parse_versioned_document(std::string_view kind, std::string_view text,
                                           std::string_view name);
/// The same of a kind that has had one version only.
nlohmann::json parse_document(std::string_view kind, std::string_view text, std::string_view name);

/// An object that begins with the schema's name and version.
nlohmann::ordered_json make_document(std::string_view kind);

/// Writes what is given.
template <typename T>
void add_optional(nlohmann::ordered_json& object, const char* key, const std::optional<T>& value) {
  if (value) object[key] = *value;
}

/// Refuses an id that came before (`seen` collects them).
std::string unique_id_from(const JsonNode& object, std::set<std::string, std::less<>>& seen);
/// A path without control characters.
std::string path_from(const JsonNode& text);
/// A relative path that stays inside its folder.
std::string relative_path_from(const JsonNode& text);
Nanoseconds utc_from(const JsonNode& text);

std::optional<DepthRange> depth_range_from(const JsonNode& object);
void add_depth_range(const std::optional<DepthRange>& range, nlohmann::ordered_json& object);

/// Reads id, size, intrinsics, pose and place in the grid; the pose must be rigid.
CameraGeometry camera_from(const JsonNode& object, std::set<std::string, std::less<>>& seen);
nlohmann::ordered_json json_from(const CameraGeometry& camera);

/// Reads what a camera's codes stand for; pixels must be in the camera's picture.
PhotometricResponse photometric_from(const JsonNode& object, const CameraGeometry& camera);
nlohmann::ordered_json json_from(const PhotometricResponse& response);

/// Numbers, text, true and false by name; remarks ("x_", "comment") are left out.
OptionValues options_from(const JsonNode& object);
nlohmann::ordered_json json_from(const OptionValues& options);

}  // namespace raystage
