// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "store/jpeg/rgb_image.h"

namespace raystage::images {

/// Writes an image as PNG of 8 bits under a temporary name and renames it. Throws Error (failed) if
/// the file cannot be written.
void write_png(const store::RgbImage& image, const std::filesystem::path& file);

}  // namespace raystage::images
