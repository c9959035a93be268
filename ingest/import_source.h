// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "ingest/model_manifest.h"

namespace raystage::ingest {

/// The manifest of a take, and the folder of its relative paths (empty: the current folder).
struct ImportSource {
  schemas::ImportManifest manifest;
  std::filesystem::path base = {};
  std::vector<std::string> notes = {};  ///< approximations and what was ignored, as sentences
};

/// Detects the format of `path` from its contents and returns its manifest. Accepted are an import
/// manifest, a file of one of rig_formats(), or a folder that contains one of these. A folder is
/// searched for import.json, then for the files of each of rig_formats(). Throws Error (bad input).
ImportSource open_import_source(const std::filesystem::path& path,
                                const ModelImportOptions& options);

}  // namespace raystage::ingest
