// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <stop_token>
#include <string>

#include "replay/view_rendering.h"
#include "schemas/viewer_message.h"

namespace raystage::replay {

/// Writes the requested frame at the size of the shot, atomically, as `raystage render` (.exr) and
/// `raystage preview` (.png) write it: the same bytes, if the camera is that of the shot. An
/// existing file is replaced only if the request says so. Throws Error (bad input) for another
/// extension, and Cancelled.
void write_snapshot(const ShownShot& shown, const schemas::ViewerMessage& request,
                    const std::filesystem::path& file, const std::string& program_version,
                    const std::stop_token& stop);

}  // namespace raystage::replay
