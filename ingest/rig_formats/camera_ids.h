// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace raystage::ingest {

/// Returns a camera id for each image file name: the name without folder and extension, reduced to
/// characters that are safe in file names. Names that are not unique keep their folders as a
/// prefix; if that is not enough, a number is appended. Cost: n log n.
std::vector<std::string> make_camera_ids(std::span<const std::string> image_names);

/// Returns whether a name has control characters: NUL would end the path, others could control a
/// terminal.
bool has_control_characters(std::string_view name);

}  // namespace raystage::ingest
