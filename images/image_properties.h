// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>

namespace raystage::images {

enum class PixelType : std::uint8_t { kUint8, kUint16, kHalf, kFloat };

/// Bytes of one value.
constexpr std::size_t size_of(PixelType type) {
  return type == PixelType::kUint8 ? 1 : type == PixelType::kFloat ? 4 : 2;
}

/// What an image file states of a level of its pixels.
struct ImageProperties {
  int x = 0, y = 0, width = 0, height = 0;                      ///< data window, pixels
  int full_x = 0, full_y = 0, full_width = 0, full_height = 0;  ///< display window, pixels
  int tile_width = 0, tile_height = 0;                          ///< pixels; 0: the file has rows
  int channels = 0;
  int alpha_channel = -1;  ///< -1: none
  PixelType type = PixelType::kUint8;

  bool holds_integers() const { return type == PixelType::kUint8 || type == PixelType::kUint16; }
  std::size_t pixels() const {
    return static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  }
  bool operator==(const ImageProperties&) const = default;
};

}  // namespace raystage::images
