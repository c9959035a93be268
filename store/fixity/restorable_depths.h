// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>

namespace raystage::store {

/// Returns whether a file, relative to the takes, is an imported depth map that is damaged or
/// unreadable in a take and intact in its copy.
bool is_damaged_map(const std::string& file, const std::filesystem::path& take,
                    const std::filesystem::path& copy);

/// Throws Error (bad input) if `text` is not a list of imported depth maps that names all maps of a
/// take: with a list that does not, an import would remove the others.
void check_list_of_maps(const std::filesystem::path& take, const std::string& text);

}  // namespace raystage::store
