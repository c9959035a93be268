// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

namespace raystage::store {

/// An 8-bit RGB image, row-major, 3 bytes per pixel without padding, top left first. The codes are
/// in the file's colour space (usually sRGB).
struct RgbImage {
  int width = 0, height = 0;
  std::vector<std::uint8_t> pixels;
  bool operator==(const RgbImage&) const = default;
};

}  // namespace raystage::store
