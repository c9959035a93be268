// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

namespace raystage::store {

/// A picture of more than 8 bits per sample.
struct DeepPicture {
  int width = 0, height = 0;  ///< pixels
  /// R, G, B per pixel, row by row: the bits of half floats, or integers of the encoding's bits.
  std::vector<std::uint16_t> samples;
  bool operator==(const DeepPicture&) const = default;
};

}  // namespace raystage::store
