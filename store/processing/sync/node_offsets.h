// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string_view>
#include <vector>

#include "store/processing/sync/flash.h"
#include "store/processing/sync/resync.h"

namespace raystage {

/// Reads {"NAME": MILLISECONDS, ...}: how far the clock of a node, or of one camera (which then
/// counts instead of its node's), is ahead. Per camera, in ns; 0 where nothing is said. Throws
/// Error (bad input): no such object, a name that is neither, a number beyond a day.
std::vector<Nanoseconds> read_node_offsets(const std::filesystem::path& file,
                                           const std::vector<CameraStamps>& cameras);
/// The same in memory; `name` stands for the file in errors.
std::vector<Nanoseconds> parse_node_offsets(std::string_view text, std::string_view name,
                                            const std::vector<CameraStamps>& cameras);

/// Adds what flashes say to each camera's offset (empty: none yet).
void add_offsets(const FlashOffsets& flash, bool per_node, const std::vector<CameraStamps>& cameras,
                 std::vector<Nanoseconds>& offsets);

}  // namespace raystage
