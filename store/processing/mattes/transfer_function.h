// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "store/processing/frames/frame_matte.h"

namespace raystage::store {

/// Converts between codes of decoded frames and linear light, by tables.
class TransferFunction {
 public:
  explicit TransferFunction(const CodeScale& scale);

  float linear(std::uint16_t code) const { return linear_[code]; }
  /// Returns the code, 0 to 65535, not rounded.
  float code(float linear) const;
  /// Returns the code on the sRGB curve, full scale 1, whatever the scale of the frames.
  float srgb(float linear) const;

 private:
  BlendSpace space_;
  float full_scale_;
  std::vector<float> linear_;   // per code
  std::vector<float> of_root_;  // sRGB code at equal steps of the square root of linear light
};

}  // namespace raystage::store
