// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <span>

namespace raystage::compose {

/// The range of depths that false colours show, 1 / metres.
struct InverseDepthSpan {
  double far = 0, near = 1;
};

/// Returns the colour of a share in [0, 1]: dark blue, cyan, green, yellow, red.
std::array<std::uint8_t, 3> false_color(double share);

/// Returns the inverse depths between the 1st and the 99th percentile of a picture's pixels, at
/// least 2e-6 apart; far = 0 and near = 1 if none has a depth. `z`: metres.
InverseDepthSpan inverse_depth_span(std::span<const float> z);

/// Converts depths (metres) to R, G, B codes: false colours, linear in inverse depth, as the
/// precision of a light field is; dark grey without depth.
void show_depth(std::span<const float> z, const InverseDepthSpan& span,
                std::span<std::uint8_t> codes);

}  // namespace raystage::compose
