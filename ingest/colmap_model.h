// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "ingest/model_manifest.h"

namespace raystage::ingest {

/// Reads a COLMAP text model (cameras.txt and images.txt in `folder`). Every registered image
/// becomes a camera at time 0; cameras are sorted by image name. Supported camera models:
/// SIMPLE_PINHOLE, PINHOLE, SIMPLE_RADIAL, RADIAL and OPENCV.
///
/// COLMAP's cameras look along +z with y down, and its poses are camera_from_world; ours look along
/// -z with y up, and our poses are world_from_camera. World coordinates are not changed, so points
/// of the model remain valid. Pixel coordinates agree (centre of the top-left pixel at 0.5, 0.5).
///
/// Images are searched in settings.images if it is given. Otherwise they are searched in images/
/// next to `folder`, next to its parent and inside `folder`, then in `folder` itself. Their paths
/// in the manifest are relative to the current folder. Throws Error (bad input) with file and line.
schemas::ImportManifest read_colmap_model(const std::filesystem::path& folder,
                                          const ModelImportOptions& options);

}  // namespace raystage::ingest
