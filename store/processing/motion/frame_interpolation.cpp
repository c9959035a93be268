// SPDX-License-Identifier: Apache-2.0
#include "store/processing/motion/frame_interpolation.h"

#include "store/processing/motion/motion_module.h"

namespace raystage::store {

RgbImage blend(const RgbImage& a, const RgbImage& b, double part) {
  RgbImage out(a.width, a.height);
  const auto weight = static_cast<float>(part);
  for (std::size_t i = 0; i < out.values.size(); ++i) {
    const float value =
        (1 - weight) * static_cast<float>(a.values[i]) + weight * static_cast<float>(b.values[i]);
    out.values[i] = static_cast<std::uint8_t>(value + 0.5F);
  }
  return out;
}

RgbImage interpolate_frame(const FlowImage& a, const FlowImage& b, const FlowField& b_from_a,
                           const FlowField& a_from_b, const InstantBetween& instant) {
  RgbImage out(a.rgb.width, a.rgb.height);
  motion_module().interpolate_codes({a.luma, b.luma, b_from_a, a_from_b}, instant, a.rgb.values,
                                    b.rgb.values, out.values);
  return out;
}

void interpolate_levels(const MovingPair& pair, const InstantBetween& instant,
                        std::span<const std::uint16_t> a, std::span<const std::uint16_t> b,
                        std::span<std::uint16_t> out) {
  motion_module().interpolate_levels(pair, instant, a, b, out);
}

}  // namespace raystage::store
