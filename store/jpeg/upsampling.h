// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>

#include "store/jpeg/layout.h"
#include "store/jpeg/scan_decoder.h"

namespace raystage::store {

/// Upsamples a component to the picture's resolution, row by row, bit for bit as libjpeg-turbo's
/// smooth upsampling (jdsample.c): a triangle filter for ratios of 2, replication otherwise.
class Upsampler {
 public:
  /// Bytes that may be written beyond the requested pixels.
  static constexpr std::size_t kPadding = 64;

  Upsampler(const JpegLayout& layout, const Plane& plane, int component);

  /// Returns the samples of pixels begin..end - 1 of the picture's row y, the first at [0]. They
  /// are in `buffer` (end - begin + kPadding bytes) or in the plane itself. `begin` must be the
  /// start of an MCU.
  const std::uint8_t* row(int y, int begin, int end, std::uint8_t* buffer) const;

 private:
  const Plane& plane_;
  int h_, v_;  ///< picture pixels per sample
  bool smooth_x_, smooth_y_;
};

}  // namespace raystage::store
