// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/time.h"
#include "schemas/geometry.h"

namespace raystage {

/// schema "raystage/import/1": what `raystage import` reads.
struct ImportManifest {
  struct Frame {
    std::string file;  ///< relative to the manifest's folder
    Nanoseconds time_ns = 0;
  };
  struct Camera {
    CameraGeometry geometry;
    std::vector<Frame> frames;          ///< either these ...
    std::string movie;                  ///< ... or a movie, relative to the manifest's folder, ...
    std::vector<Nanoseconds> times_ns;  ///< ... with the time of each of its frames
  };
  std::string name;
  Nanoseconds epoch_utc = 0;  ///< since 1970
  double nominal_fps = 0;
  std::string color_space;       ///< of the frames: "srgb_texture", "lin_rec709_scene"
  bool arbitrary_scale = false;  ///< lengths are in an unknown unit, called metres all the same
  std::optional<DepthRange> depth_range;
  std::vector<Camera> cameras;
};

/// Throws Error with file, JSON pointer, what was found and what is allowed.
/// Beyond the schema: unique ids, rigid poses, increasing times, as many times as there may be.
ImportManifest read_import_manifest(const std::filesystem::path& file);

void write_import_manifest(const ImportManifest& manifest, const std::filesystem::path& file);

/// The same in memory; `name` stands for the file in errors.
ImportManifest parse_import_manifest(std::string_view text, std::string_view name);
std::string format_import_manifest(const ImportManifest& manifest);

}  // namespace raystage
