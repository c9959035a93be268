// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>

#include "render/common/large_buffer.h"
#include "store/processing/frames/frame_cache.h"

namespace raystage {

/// Pixels [left, right) x [top, bottom) of a frame.
struct FrameBox {
  int left = 0, right = 0, top = 0, bottom = 0;
};

/// The part of a frame that is matched, as it is matched: 8-bit codes of sRGB's curve. A 32-bit
/// word holds a pixel's code in one channel (lowest byte) and those of its right, lower and lower
/// right neighbours, so a bilinear sample is one word a channel. Beyond the frame's border it goes
/// on unchanged.
class MatchingFrame {
 public:
  MatchingFrame() = default;
  /// `box`: what is matched, not empty. Codes are brought to sRGB's curve if they are linear.
  MatchingFrame(const DecodedFrame& frame, BlendSpace space, const FrameBox& box);

  const FrameBox& box() const { return box_; }
  /// Words from a row of a channel to the same row of the next channel: R, G, B of a row follow
  /// each other, then the next row's.
  std::ptrdiff_t pitch() const { return box_.right - box_.left; }
  /// Of the box's first pixel, red. 32 words and more may be read from any pixel on.
  const std::uint32_t* words() const { return words_.data(); }
  static std::size_t bytes(const FrameBox& box);

 private:
  FrameBox box_;
  LargeBuffer<std::uint32_t> words_;
};

}  // namespace raystage
