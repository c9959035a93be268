// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <string>

#include "compose/camera/chan_file.h"
#include "compose/camera/shot_camera.h"

namespace raystage::compose {

/// Returns the camera of one eye at frames of its shot as a .chan file. Not supported: lens shift.
std::string camera_to_chan(const ShotCamera& camera, std::span<const int> frames, Eye eye,
                           RotationOrder order);

/// Returns it as a .gltf document called `name`. Time 0 is the shot's first frame.
std::string camera_to_gltf(const ShotCamera& camera, const schemas::ShotDocument& shot,
                           std::span<const int> frames, Eye eye, const std::string& name);

}  // namespace raystage::compose
