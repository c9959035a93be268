// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string_view>

#include "store/jpeg/rgb_image.h"

namespace raystage {

/// Pixels.
struct SourceImageSize {
  int width = 0, height = 0;
  bool operator==(const SourceImageSize&) const = default;
};

/// From the file's header alone. Throws Error (bad input) where the file is no image.
SourceImageSize image_size(const std::filesystem::path& file);

/// An image as the sRGB codes that a take holds. `linear`: its values are scene-linear light
/// (float, half or integer), which is clipped to [0, 1] and put through sRGB's curve; otherwise
/// they are sRGB codes already, of 8 or 16 bits (rounded to 8). Grey becomes R = G = B, alpha is
/// dropped. Throws Error (bad input): unreadable, not of `size`, or floating point that is not
/// declared linear.
RgbImage read_source_image(const std::filesystem::path& file, SourceImageSize size, bool linear);

/// Refuses an image whose size is not its camera's; `name` stands in the error.
void check_image_size(SourceImageSize found, SourceImageSize expected, std::string_view name);

}  // namespace raystage
