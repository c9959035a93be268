// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

namespace raystage {

/// 8-bit RGB, row-major, 3 bytes a pixel without padding, top left first. The codes are whatever
/// the file's colour space says (usually sRGB).
struct RgbImage {
  int width = 0, height = 0;
  std::vector<std::uint8_t> pixels;
  bool operator==(const RgbImage&) const = default;
};

}  // namespace raystage
