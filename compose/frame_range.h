// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace raystage {

/// Reads a set of frames: frames and ranges separated by commas, a range with an optional step:
/// "1-48", "1-48x2", "1,5,10-20x2", "-5--1". The result is sorted and without duplicates.
///
/// ':' is refused: "1-10:5" is every frame in five passes for OpenCue and fileseq, but every fifth
/// frame for Slurm and Open Job Description. 'y' (all but every n-th) is refused too. Throws Error
/// (bad input) with the position in the text.
std::vector<int> parse_frame_range(std::string_view text);

/// The shortest such text for frames that are sorted and distinct ("" for none).
std::string format_frame_range(std::span<const int> frames);

}  // namespace raystage
