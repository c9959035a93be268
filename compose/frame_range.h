// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace raystage::compose {

/// Returns the frames of a list of frames and ranges with optional steps, sorted, without
/// duplicates: "1-48", "1-48x2", "1,5,10-20x2", "-5--1". Rejects 'y' (all but every n-th) and ':'.
/// For OpenCue and fileseq "1-10:5" is every frame in five passes, but for Slurm and Open Job
/// Description it is every fifth frame. Throws Error (bad input) with the position in the text.
std::vector<int> parse_frame_range(std::string_view text);

/// Returns the number of frames of such a list without making it: duplicates count twice. Throws as
/// parse_frame_range().
std::int64_t frame_range_size(std::string_view text);

/// Returns a short text that parse_frame_range() parses to these sorted, distinct frames ("" for
/// none).
std::string format_frame_range(std::span<const int> frames);

}  // namespace raystage::compose
