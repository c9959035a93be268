// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string_view>

#include "ingest/model_manifest.h"

namespace raystage::ingest {

/// Reads a NeRF transforms.json (of NeRF's own data sets, instant-ngp or nerfstudio): `text` is the
/// content of `file`. Every frame becomes a camera at time 0, in the order of the file.
///
/// Properties at the top level apply to all frames; a frame may override them. They are fl_x, fl_y
/// (pixels) or camera_angle_x, camera_angle_y (radians); cx, cy (default: the image centre); w, h
/// (default: the image's size); k1, k2, k3, p1, p2; camera_model OPENCV, PINHOLE or SIMPLE_PINHOLE.
/// Not supported: fisheye lenses. transform_matrix is world_from_camera in our axes; a uniform
/// scale is removed from it. World coordinates are not changed. file_path may lack its extension
/// and is relative to settings.images or to the file's folder. Throws Error (bad input) with the
/// JSON pointer.
schemas::ImportManifest read_nerf_transforms(const std::filesystem::path& file,
                                             std::string_view text,
                                             const ModelImportOptions& options);

}  // namespace raystage::ingest
