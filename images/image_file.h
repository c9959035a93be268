// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "store/jpeg/rgb_image.h"

namespace raystage::images {

/// Reads any image that OpenImageIO supports (PNG, JPEG, TIFF, ...) as 8-bit RGB codes, without
/// colour conversion; grey becomes R = G = B, alpha is dropped. Throws Error (bad input).
store::RgbImage read_image(const std::filesystem::path& file);

/// Writes an image in the format of the extension under a temporary name and renames it. Throws
/// Error (bad input) for an unsupported format, Error (failed) if the file cannot be written.
void write_image(const store::RgbImage& image, const std::filesystem::path& file);

}  // namespace raystage::images
