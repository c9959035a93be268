// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

namespace raystage::images {

/// Throws std::runtime_error if an attribute of an EXR file's headers, or a string in one, states
/// to be larger than the file: OpenEXR allocates what is stated before it reads. Files that are no
/// EXR files pass, as OpenEXR names what is wrong with them.
void require_plausible_exr_header(const std::filesystem::path& file);

}  // namespace raystage::images
