// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string_view>

#include "images/image_reader.h"
#include "store/jpeg/rgb_image.h"

namespace raystage::ingest {

/// Size of an image in pixels.
struct SourceImageSize {
  int width = 0, height = 0;
  bool operator==(const SourceImageSize&) const = default;
};

/// Returns the size in the file's header. Throws Error (bad input) if the file is not an image.
SourceImageSize image_size(const images::ImageReader& reader, const std::filesystem::path& file);

/// Reads an image as the 8-bit sRGB codes that a take stores. If `linear`, its values are
/// scene-linear light (float, half or integer): they are clipped to [0, 1] and encoded with the
/// sRGB curve. Otherwise they are sRGB codes of 8 or 16 bits (rounded to 8). Grey becomes
/// R = G = B; alpha is dropped. Throws Error (bad input) if the file is unreadable, is not of
/// `size`, or has floating-point values that are not linear.
store::RgbImage read_source_image(const images::ImageReader& reader,
                                  const std::filesystem::path& file, SourceImageSize size,
                                  bool linear);

/// Throws Error (bad input) if the size of an image differs from that of its camera. `name`
/// identifies the image in the error.
void check_image_size(SourceImageSize found, SourceImageSize expected, std::string_view name);

}  // namespace raystage::ingest
