// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace raystage::store {

struct FoundTakes {
  std::vector<std::string> paths;     ///< relative to the folder, sorted; "." is the folder itself
  std::vector<std::string> problems;  ///< folders that cannot be read, with the reason
};

/// Returns the takes (folders with a take.json) below a folder. Links and hidden folders are not
/// followed, and takes within takes not found.
FoundTakes find_takes(const std::filesystem::path& folder);

/// Returns the XXH3-64 of the names, sizes and modification times of a take's files but derived
/// ones (depth/, hidden ones), as 16 hexadecimal digits: whether something was changed since a
/// check.
std::string state_of_take(const std::filesystem::path& take);

}  // namespace raystage::store
