// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "store/jpeg/rgb_image.h"

namespace raystage::images {

/// Writes an image in the format of the extension under a temporary name and renames it. Throws
/// Error (bad input) for an unsupported format, Error (failed) if the file cannot be written.
void write_image(const store::RgbImage& image, const std::filesystem::path& file);

/// Writes values of 32 bits as an EXR file. `values`: interleaved, row by row, width x height x
/// channels. Throws Error (failed) as write_image().
void write_channels(int width, int height, const std::vector<std::string>& channels,
                    std::span<const float> values, const std::filesystem::path& file);
/// Writes planar depths as an EXR file with the channel Z (metres, 32 bits). `z`: row by row,
/// width x height. Throws Error (failed) as write_image().
void write_depth_image(int width, int height, std::span<const float> z,
                       const std::filesystem::path& file);

}  // namespace raystage::images
