// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/frame_rate.h"
#include "compose/camera/chan_file.h"
#include "compose/camera/shot_camera.h"

namespace raystage::compose {

/// Returns the camera of one eye at frames of its shot as a .chan file, without lens shift. Its
/// vertical field of view is that of the picture.
std::string camera_to_chan(const ShotCamera& camera, std::span<const int> frames, Eye eye,
                           RotationOrder order);

/// Returns it as a .gltf document called `name`, without lens shift. The time of a frame is its
/// number divided by the frame rate, and the document states both. `frames`: at least one. `rate`:
/// instead of that of the shot.
std::string camera_to_gltf(const ShotCamera& camera, const schemas::ShotDocument& shot,
                           std::span<const int> frames, Eye eye, const std::string& name,
                           std::optional<FrameRate> rate = {});

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
  std::optional<FrameRate> gltf_rate = {};    ///< of times in .gltf files; none: that of the shot
};

/// Returns what a file in the format of its extension cannot hold of the camera, in words.
std::vector<std::string> camera_file_losses(const CameraExport& exported,
                                            const std::filesystem::path& file);
/// Throws Error (bad input) if the file would lose anything. `what_to_do`: of the error.
void check_camera_file_losses(const CameraExport& exported, const std::filesystem::path& file,
                              const std::string& what_to_do);

/// Returns the text of a file in the format of its extension: .chan, .gltf or .nk. Throws Error
/// (bad input) for any other.
std::string format_camera_file(const CameraExport& exported, const std::filesystem::path& file);

}  // namespace raystage::compose
