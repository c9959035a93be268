// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace raystage::store {

/// Paths are relative to the folder that was searched; "." is that folder itself.
struct FoundTakes {
  struct Problem {
    std::string path;  ///< of a folder: which takes are there is not known
    std::string what;
  };
  std::vector<std::string> paths;  ///< of the takes, sorted
  std::vector<Problem> problems;   ///< folders that cannot be read, with the reason
  /// Folders without any entry: the disk that is mounted there may be absent.
  std::vector<std::string> empty_folders;
};

/// Returns the takes (folders with a take.json) below a folder. Links and hidden folders are not
/// followed, and takes within takes not found.
FoundTakes find_takes(const std::filesystem::path& folder);

/// Returns whether a path of FoundTakes is a folder or below it.
bool is_at_or_below(std::string_view path, std::string_view folder);

/// Returns the XXH3-64 of the names, sizes and modification times of a take's regular files but
/// derived ones (depth/, hidden ones), as 16 hexadecimal digits: whether something was changed
/// since a check. Links are not followed and do not count. Throws Error (failed) if a folder or a
/// file's size or time cannot be read.
std::string state_of_take(const std::filesystem::path& take);

}  // namespace raystage::store
