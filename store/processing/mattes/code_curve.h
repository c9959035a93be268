// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "store/processing/frames/frame_matte.h"

namespace raystage {

/// Between codes of decoded frames and linear light, by tables.
class CodeCurve {
 public:
  explicit CodeCurve(const CodeScale& scale);

  float linear(std::uint16_t code) const { return linear_[code]; }
  /// 0 to 65535, not rounded.
  float code(float linear) const;
  /// Of sRGB's curve, full scale 1, whatever the codes' own.
  float srgb(float linear) const;

 private:
  bool perceptual_;
  float full_scale_;
  std::vector<float> linear_;   // of each code
  std::vector<float> of_root_;  // sRGB of squares: of steps of the root of linear light
};

}  // namespace raystage
