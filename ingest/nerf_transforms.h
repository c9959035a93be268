// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string_view>

#include "ingest/model_manifest.h"

namespace raystage {

/// Reads a NeRF transforms.json (of NeRF's own data sets, instant-ngp or nerfstudio): `text` is the
/// content of `file`. Every frame becomes a camera at time 0, in the order of the file.
///
/// Understood, for all frames or in one: fl_x, fl_y, or camera_angle_x, camera_angle_y (radians);
/// cx, cy (the middle unless given); w, h (the image's own size unless given); k1, k2, k3, p1, p2;
/// camera_model OPENCV, PINHOLE or SIMPLE_PINHOLE; fisheyes are refused. transform_matrix is
/// world_from_camera with axes as ours; a uniform scale in it is removed. The world stays as it is.
/// file_path may lack its extension; relative to settings.images or the file's folder.
/// Throws Error (bad input) with the JSON pointer.
ImportManifest read_nerf_transforms(const std::filesystem::path& file, std::string_view text,
                                    const ModelImportSettings& settings);

}  // namespace raystage
