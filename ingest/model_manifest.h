// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "ingest/rig_formats/rig_format.h"
#include "schemas/import_manifest.h"

namespace raystage::ingest {

/// Settings of a take that a model of another program does not contain.
struct ModelImportOptions {
  /// Folder of the pictures; searched if not given.
  std::optional<std::filesystem::path> images = std::nullopt;
  Nanoseconds epoch_utc = 0;  ///< since 1970
  /// Frames per second; nullopt: the rate of the movies, or else kDefaultFps.
  std::optional<double> nominal_fps = std::nullopt;
  bool has_pictures = true;  ///< false: only cameras are read, without pictures
  static constexpr double kDefaultFps = 24;
  bool is_valid(std::string* reason) const;
};

/// Returns the manifest of a rig, named after the folder of its file. Pictures that the rig names
/// are at time 0. Those of other cameras are found by their ids, in the first of `picture_folders`
/// that has some of the first camera (see model_pictures.h); frame i is at i / nominal_fps. Throws
/// Error (bad input) at a camera without pictures.
schemas::ImportManifest make_model_manifest(const ForeignRig& rig,
                                            const std::filesystem::path& file,
                                            std::span<const std::filesystem::path> picture_folders,
                                            const ModelImportOptions& options);

}  // namespace raystage::ingest
