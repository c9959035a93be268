// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "schemas/import_manifest.h"

namespace raystage::ingest {

/// Settings of a take that a COLMAP or NeRF model does not contain.
struct ModelImportOptions {
  std::optional<std::filesystem::path> images;  ///< folder of the images; searched if not given
  Nanoseconds epoch_utc = 0;                    ///< since 1970
  double nominal_fps = 24;
  bool is_valid(std::string* reason) const;
};

/// Returns a manifest without cameras, named after the folder of the model file.
schemas::ImportManifest make_model_manifest(const std::filesystem::path& file,
                                            const ModelImportOptions& options);

/// Returns a camera id for each image file name: the name without folder and extension, reduced to
/// characters that are safe in file names. Names that are not unique keep their folders as a
/// prefix; if that is not enough, a number is appended.
std::vector<std::string> make_camera_ids(std::span<const std::string> image_names);

/// Returns the first of `folders` that contains `image`. Throws Error (bad input) if none does.
std::filesystem::path find_image_folder(std::span<const std::filesystem::path> folders,
                                        const std::string& image,
                                        const std::filesystem::path& model);

}  // namespace raystage::ingest
