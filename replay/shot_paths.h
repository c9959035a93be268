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

/// A path in a shot. Some files are opened by one form of it, some by the other, which leads
/// elsewhere where a link is before "..".
struct ShotPath {
  std::filesystem::path written;  ///< absolute, otherwise as it is in the shot
  std::filesystem::path normal;   ///< without "." and ".."
  bool is_unambiguous = true;     ///< both lead to the same file, whatever is a link
};

/// Returns the paths in a shot's text: those of the document, and texts of the options of methods,
/// which are files that start at the layer's take. `from`: absolute folder without links from which
/// the others start. Throws Error (bad input) if the text is no JSON.
std::vector<ShotPath> shot_paths(std::string_view text, const std::filesystem::path& from);

}  // namespace raystage::replay
