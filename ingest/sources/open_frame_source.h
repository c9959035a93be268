// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>

#include "ingest/sources/frame_source.h"
#include "schemas/record_config.h"

namespace raystage {

/// Opens a camera's source. `base`: the folder that relative files of the config are in. May take
/// seconds: devices are looked for, connections made, simulated frames rendered; several cameras
/// may be opened at once by several threads. Throws Error: bad input for what is asked of the
/// source, failed where the device or network does not play along; either says what to do.
std::unique_ptr<FrameSource> open_frame_source(const RecordConfig::Camera& camera,
                                               const std::filesystem::path& base);

}  // namespace raystage
