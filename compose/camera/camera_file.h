// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>

#include "compose/camera/camera_channels.h"
#include "schemas/shot_document.h"

namespace raystage::compose {

/// A camera that was read from a file of another program.
struct ImportedCamera {
  CameraChannels channels;        ///< by the frames of the shot
  bool focal_is_animated = true;  ///< false: the file holds one focal length for all frames
  /// What was read, e.g. "move.chan, frames 1001 to 1048, film back 36 x 20.25 mm".
  std::string summary;
};

/// Reads the camera file of a shot, which has one. A time t of a glTF file is frame t x fps; the
/// rate is that of the shot's camera file, or that which the file states, or else that of the shot
/// (or 24 instead of 24000/1001 and the like, where only that has the keys at frames).
/// The vertical field of view of a .chan file belongs to the film back of the shot's camera file.
/// `file`: where it is. `where`: of the shot's camera, named by errors. Throws Error (bad input) if
/// the file cannot be used, if its keys are not at frames of the rate, or if none of its keys is
/// in the shot.
ImportedCamera import_camera(const schemas::ShotDocument& shot, const std::filesystem::path& file,
                             const std::string& where);

}  // namespace raystage::compose
