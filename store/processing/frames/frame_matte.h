// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <span>

#include "store/processing/frames/blend_space.h"

namespace raystage {

/// What the codes of decoded frames stand for.
struct CodeScale {
  BlendSpace space = BlendSpace::kPerceptual;
  double full_scale = 1;  ///< linear light of code 65535
};

/// What shows of one frame.
class FrameKey {
 public:
  virtual ~FrameKey() = default;
  /// Pixels from (x, y) on to the right, R, G, B, 65535 each: become R, G, B, A, premultiplied.
  /// Each by itself, whatever its neighbours in the row. Many threads may call it.
  virtual void key_row(int x, int y, std::span<std::uint16_t> rgba) const = 0;
};

/// What shows of a take's frames: A is put on them while they are decoded, so that the light field
/// itself is transparent, whatever looks at it.
class FrameMatte {
 public:
  virtual ~FrameMatte() = default;
  /// Throws Error (bad input) where what it takes is missing or wrong. Many threads may call it.
  virtual std::unique_ptr<const FrameKey> key_of(int camera, int frame,
                                                 const CodeScale& scale) const = 0;
};

}  // namespace raystage
