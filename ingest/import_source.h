// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "ingest/model_manifest.h"

namespace raystage::ingest {

/// The manifest of a take, and the folder of its relative paths (empty: the current folder).
struct ImportSource {
  schemas::ImportManifest manifest;
  std::filesystem::path base;
};

/// Detects the format of `path` from its contents and returns its manifest. Accepted are an import
/// manifest, a NeRF transforms.json, a file of a COLMAP text model, or a folder that contains one
/// of these. A folder is searched for import.json, then cameras.txt with images.txt (in it, in
/// sparse/0 or in sparse), then transforms.json. Throws Error (bad input).
ImportSource open_import_source(const std::filesystem::path& path,
                                const ModelImportOptions& options);

}  // namespace raystage::ingest
