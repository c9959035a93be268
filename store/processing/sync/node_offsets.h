// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string_view>
#include <vector>

#include "store/processing/sync/flash.h"
#include "store/processing/sync/resync.h"

namespace raystage::store {

/// Returns the clock offset of each camera in ns (positive: ahead), 0 if the file names neither the
/// camera nor its node. The file is {"NAME": MILLISECONDS, ...}; NAME is a node or a camera, and a
/// camera's offset replaces its node's. Throws Error (bad input) if the file is no such object, a
/// name is neither node nor camera, or a number exceeds a day.
std::vector<Nanoseconds> read_node_offsets(const std::filesystem::path& file,
                                           const std::vector<CameraTimestamps>& cameras);
/// Parses such a file's `text`; `name`: the file in errors.
std::vector<Nanoseconds> parse_node_offsets(std::string_view text, std::string_view name,
                                            const std::vector<CameraTimestamps>& cameras);

/// Adds the offsets that flashes show to each camera's offset (empty: none yet).
void add_offsets(const FlashOffsets& flash, bool per_node,
                 const std::vector<CameraTimestamps>& cameras, std::vector<Nanoseconds>& offsets);

}  // namespace raystage::store
