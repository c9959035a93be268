// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace raystage::replay {

/// Returns a shot's text for another folder: the same text, but its relative paths, which started
/// at `from`, start at `to`. Both folders are absolute. Properties that the viewer does not know
/// stay as they are. Throws Error (bad input) if the text is no JSON object, or a path is not
/// UTF-8.
std::string rebase_shot_paths(std::string_view text, const std::filesystem::path& from,
                              const std::filesystem::path& to);

/// Returns the paths in a shot's text, absolute and without "." and "..", but with their links and
/// frame numbers as they are. `from`: absolute folder from which relative paths start. Throws Error
/// (bad input) if the text is no JSON.
std::vector<std::filesystem::path> shot_paths(std::string_view text,
                                              const std::filesystem::path& from);

}  // namespace raystage::replay
