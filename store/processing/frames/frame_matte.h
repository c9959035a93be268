// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <span>

#include "store/processing/frames/blend_space.h"

namespace raystage::store {

/// The meaning of the codes of decoded frames.
struct CodeScale {
  BlendSpace space = BlendSpace::kPerceptual;
  double full_scale = 1;  ///< linear light of code 65535
};

/// Computes the alpha of the pixels of one frame.
class FrameKeyer {
 public:
  virtual ~FrameKeyer() = default;
  /// Replaces the pixels from (x, y) to the right, R, G, B, 65535 each, by premultiplied R, G, B,
  /// A. The result for a pixel does not depend on its neighbours. Thread-safe.
  virtual void key_row(int x, int y, std::span<std::uint16_t> rgba) const = 0;
};

/// The mattes of a take. Alpha is applied during decoding, so that the light field itself is
/// transparent for every reconstruction method.
class FrameMatte {
 public:
  virtual ~FrameMatte() = default;
  /// Returns the keyer of a frame. Throws Error (bad input) if an input of the matte is missing or
  /// invalid. Thread-safe.
  virtual std::unique_ptr<const FrameKeyer> make_keyer(int camera, int frame,
                                                       const CodeScale& scale) const = 0;
};

}  // namespace raystage::store
