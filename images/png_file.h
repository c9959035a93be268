// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

#include "store/jpeg/rgb_image.h"

namespace raystage::images {

/// Returns an image as a PNG file of 8 bits. Throws Error (failed) if it cannot be encoded; `name`
/// is where the error says that it is.
std::vector<std::byte> encode_png(const store::RgbImage& image, const std::string& name);

/// Writes an image as PNG of 8 bits under a temporary name and renames it. Throws Error (failed) if
/// the file cannot be written.
void write_png(const store::RgbImage& image, const std::filesystem::path& file);

}  // namespace raystage::images
