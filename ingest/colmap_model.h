// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "ingest/model_manifest.h"

namespace raystage {

/// Reads a COLMAP text model: cameras.txt and images.txt in `folder`. Every registered image
/// becomes a camera at time 0, by name. Camera models SIMPLE_PINHOLE, PINHOLE, SIMPLE_RADIAL,
/// RADIAL and OPENCV.
///
/// COLMAP's cameras look along +z with y down and map world to camera; ours look along -z with y
/// up and map camera to world. The world stays as it is in the model, so that its points and other
/// views in it fit. Pixel coordinates are the same (centre of the top-left pixel at 0.5, 0.5).
///
/// Images are looked for in settings.images, or else in images/ beside the model's folder, beside
/// its parent, in it, or in the folder itself; their paths in the manifest are
/// relative to the current folder.
/// Throws Error (bad input) with file and line.
ImportManifest read_colmap_model(const std::filesystem::path& folder,
                                 const ModelImportSettings& settings);

}  // namespace raystage
