// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>

#include "base/large_buffer.h"
#include "store/processing/frames/frame_cache.h"

namespace raystage::render {

/// Pixels [left, right) x [top, bottom) of a frame.
struct FrameBox {
  int left = 0, right = 0, top = 0, bottom = 0;
};

/// The matched part of a frame in 8-bit codes of the sRGB curve. A 32-bit word holds four codes of
/// one channel: the pixel's (lowest byte) and those of its right, lower and lower right neighbours.
/// So a bilinear sample reads one word per channel. Border pixels of the frame are repeated
/// outwards.
class MatchingFrame {
 public:
  MatchingFrame() = default;
  /// Converts a frame. `box`: the matched part, not empty. Linear codes are converted to the sRGB
  /// curve.
  MatchingFrame(const store::DecodedFrame& frame, const store::CodeScale& scale,
                const FrameBox& box);

  const FrameBox& box() const { return box_; }
  /// Returns the words from a row of a channel to the same row of the next channel. The R, G, B of
  /// a row are followed by those of the next row.
  std::ptrdiff_t pitch() const { return box_.right - box_.left; }
  /// Returns the words of the box's first pixel, red. At least 32 words may be read from any pixel
  /// on.
  const std::uint32_t* words() const { return words_.data(); }
  static std::size_t bytes(const FrameBox& box);

 private:
  FrameBox box_;
  LargeBuffer<std::uint32_t> words_;
};

}  // namespace raystage::render
