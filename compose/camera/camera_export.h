// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <string_view>

#include "compose/camera/chan_file.h"
#include "compose/camera/shot_camera.h"

namespace raystage::compose {

/// Returns the camera of one eye at frames of its shot as a .chan file. Not supported: lens shift.
std::string camera_to_chan(const ShotCamera& camera, std::span<const int> frames, Eye eye,
                           RotationOrder order);

/// Returns it as a .gltf document called `name`. Time 0 is the shot's first frame.
std::string camera_to_gltf(const ShotCamera& camera, const schemas::ShotDocument& shot,
                           std::span<const int> frames, Eye eye, const std::string& name);

/// Returns it as a Nuke script with a Camera2 node called `name` (letters, digits and underscores
/// are kept), with lens shift, focus distance and f-number.
std::string camera_to_nuke_script(const ShotCamera& camera, const schemas::ShotDocument& shot,
                                  std::span<const int> frames, Eye eye, std::string_view name);

/// A camera of a shot to be written to a file of another program.
struct CameraExport {
  const ShotCamera& camera;
  const schemas::ShotDocument& shot;
  std::span<const int> frames;
  Eye eye = Eye::kBoth;
  RotationOrder order = RotationOrder::kZxy;  ///< of .chan files
  std::string name = {};                      ///< of the camera; empty: the shot's, or "camera"
};

/// Returns the text of a file in the format of its extension: .chan, .gltf or .nk. Throws Error
/// (bad input) for any other.
std::string format_camera_file(const CameraExport& exported, const std::filesystem::path& file);

}  // namespace raystage::compose
