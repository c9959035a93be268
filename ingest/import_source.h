// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "ingest/model_manifest.h"

namespace raystage {

/// What a take is made of, and the folder that its relative paths begin in (empty: the current
/// one).
struct ImportSource {
  ImportManifest manifest;
  std::filesystem::path base;
};

/// Tells by the contents what `path` is: an import manifest, a NeRF transforms.json, a file of a
/// COLMAP text model, or a folder that holds one of these (import.json first, then cameras.txt with
/// images.txt, there or in sparse/0 or sparse, then transforms.json). Throws Error (bad input).
ImportSource open_import_source(const std::filesystem::path& path,
                                const ModelImportSettings& settings);

}  // namespace raystage
