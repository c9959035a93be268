// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "store/jpeg/rgb_image.h"

namespace raystage {

/// Reads any image that OpenImageIO supports (PNG, JPEG, TIFF, ...) as 8-bit RGB codes, without
/// colour conversion; grey becomes R = G = B, alpha is dropped. Throws Error (bad input).
RgbImage read_image(const std::filesystem::path& file);

/// Writes a PNG (or the format of the extension) under a temporary name and renames it. Throws
/// Error.
void write_image(const RgbImage& image, const std::filesystem::path& file);

}  // namespace raystage
