// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <string>

#include "compose/camera/chan_file.h"
#include "compose/camera/shot_camera.h"

namespace raystage {

/// One eye's camera at frames of its shot as a .chan file. A shifted lens is not told.
std::string camera_to_chan(const ShotCamera& camera, std::span<const int> frames, Eye eye,
                           RotationOrder order);

/// The same as a .gltf document called `name`; time 0 is the shot's first frame.
std::string camera_to_gltf(const ShotCamera& camera, const ShotDocument& shot,
                           std::span<const int> frames, Eye eye, const std::string& name);

}  // namespace raystage
