// SPDX-License-Identifier: Apache-2.0
#include "store/processing/frames/flow_luma.h"

#include <algorithm>

#include "base/transfer_function.h"
#include "store/processing/frames/matching_code.h"

namespace raystage::store {

std::vector<std::uint8_t> flow_codes(const CodeScale& scale) {
  constexpr double kWhite = 255, kLevels = 65535;
  std::vector<std::uint8_t> table(static_cast<std::size_t>(kLevels) + 1);
  for (std::size_t level = 0; level < table.size(); ++level) {
    const double value = static_cast<double>(level) / kLevels;
    const double light = part_from_value(scale.space, value) * scale.full_scale;
    const double code = scale.space == BlendSpace::kHighRange
                            ? matching_code(scale, light)
                            : srgb_from_linear(std::min(1.0, light));
    table[level] = static_cast<std::uint8_t>(std::clamp(kWhite * code + 0.5, 0.0, kWhite));
  }
  return table;
}

Luma flow_luma(std::span<const std::uint16_t> rgba, int width, int height,
               std::span<const std::uint8_t> codes) {
  Luma luma(width, height);
  for (std::size_t i = 0; i < luma.values.size(); ++i) {
    const unsigned sum =
        77U * codes[rgba[4 * i]] + 150U * codes[rgba[4 * i + 1]] + 29U * codes[rgba[4 * i + 2]];
    luma.values[i] = static_cast<std::uint8_t>((sum + 128U) >> 8U);
  }
  return luma;
}

}  // namespace raystage::store
