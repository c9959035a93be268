// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <memory>
#include <stop_token>
#include <vector>

#include "replay/shot_files.h"
#include "replay/view_rendering.h"

namespace raystage::replay {

/// Returns the scene of a shot, opened if it is not open yet. Throws Error (bad input).
using OpenScene = std::function<std::shared_ptr<const Scene>(
    const schemas::ShotDocument& shot, const std::filesystem::path& shot_file)>;

/// Returns the message with the picture that a request compares its view with
/// (ViewerMessage::comparison): another shot at the same frame, from the request's camera or else
/// its own, or the frame of a rendered sequence. Throws Error (bad input) if it cannot be read, and
/// Cancelled.
std::vector<std::byte> render_comparison(const ShownShot& shown,
                                         const schemas::ViewerMessage& request,
                                         const ShotFiles& files, const OpenScene& open_scene,
                                         const std::stop_token& stop);

}  // namespace raystage::replay
