// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/time.h"
#include "schemas/geometry.h"

namespace raystage::schemas {

/// Schema "raystage/import/1": the input of `raystage import`.
struct ImportManifest {
  struct Frame {
    std::string file;  ///< relative to the manifest's folder
    Nanoseconds time_ns = 0;
  };
  struct Camera {
    CameraGeometry geometry;
    std::vector<Frame> frames;  ///< either these ...
    std::string movie;          ///< ... or a movie, relative to the manifest's folder, ...
    /// ... with the time of each of its frames; empty: frame i is at i / nominal_fps.
    std::vector<Nanoseconds> times_ns;
  };
  std::string name;
  Nanoseconds epoch_utc = 0;  ///< since 1970
  double nominal_fps = 0;
  std::string color_space;       ///< of the frames: "srgb_texture", "lin_rec709_scene"
  bool arbitrary_scale = false;  ///< the unit of length is unknown, though called metres
  std::optional<DepthRange> depth_range;
  std::vector<Camera> cameras;
};

/// Reads the document. Throws Error (bad input) with the file, the JSON pointer, the value found
/// and what is allowed. Beyond the schema, it checks that ids are unique, poses rigid and times
/// increasing, and that every camera has the whole depth range in front of it.
ImportManifest read_import_manifest(const std::filesystem::path& file);
void write_import_manifest(const ImportManifest& manifest, const std::filesystem::path& file);

/// Parses and formats the document in memory; errors use `name` as the file name.
ImportManifest parse_import_manifest(std::string_view text, std::string_view name);
std::string format_import_manifest(const ImportManifest& manifest);

}  // namespace raystage::schemas
