// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "store/jpeg/rgb_image.h"

namespace raystage::images {

/// Writes an image in the format of the extension under a temporary name and renames it. Throws
/// Error (bad input) for an unsupported format, Error (failed) if the file cannot be written.
void write_image(const store::RgbImage& image, const std::filesystem::path& file);

}  // namespace raystage::images
