// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "base/time.h"

namespace raystage::schemas {

/// Schema "raystage/imported_depths/1": the depth maps of a take that were made elsewhere.
struct ImportedDepthsDocument {
  /// Where the document is in a take; the files of the maps are relative to its folder.
  static constexpr const char* kFolder = "imported_depth";
  static constexpr const char* kFile = "imported_depth/maps.json";

  /// Where maps come from.
  struct Import {
    Nanoseconds utc = 0;  ///< since 1970
    std::string by;       ///< program and version
    std::string folder;   ///< of the imported files; a note
    std::string encoding;
    bool operator==(const Import&) const = default;
  };
  enum class Quantity {
    kInverseDepth,    ///< of the planar depth along the camera's axis
    kInverseDistance  ///< of the distance from the camera's centre
  };
  struct Map {
    std::int32_t frame = 0;  ///< in the camera's archive
    std::string frame_xxh3;  ///< of its JPEG; 16 hexadecimal digits
    std::string file;        ///< relative to the document
    Quantity quantity = Quantity::kInverseDepth;
    int width = 0, height = 0;  ///< pixels
    double unknown_share = 0;   ///< of the pixels
    int import = 0;             ///< index in `imports`
    std::string source;         ///< relative to Import::folder
    std::string source_sha256;
    bool operator==(const Map&) const = default;
  };
  struct Camera {
    std::string id;
    std::vector<Map> maps;  ///< by increasing frame
    bool operator==(const Camera&) const = default;
  };
  std::vector<Import> imports;
  std::vector<Camera> cameras;
  bool operator==(const ImportedDepthsDocument&) const = default;

  /// Returns the map of a frame, or null if there is none.
  const Map* find(std::string_view camera, std::int32_t frame) const;
};

/// Parses and formats the document in memory; errors use `name` as the file name. Throws Error (bad
/// input) with the JSON pointer, the value found and what is allowed.
ImportedDepthsDocument parse_imported_depths(std::string_view text, std::string_view name);
std::string format_imported_depths(const ImportedDepthsDocument& document);
void write_imported_depths(const ImportedDepthsDocument& document,
                           const std::filesystem::path& file);

}  // namespace raystage::schemas
