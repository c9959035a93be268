// SPDX-License-Identifier: Apache-2.0
#include "compose/preview/false_color.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

namespace raystage::compose {

std::array<std::uint8_t, 3> false_color(double share) {
  constexpr std::array<std::array<double, 3>, 6> kStops{{{20, 20, 110},
                                                         {30, 110, 230},
                                                         {40, 200, 190},
                                                         {120, 220, 60},
                                                         {245, 200, 40},
                                                         {215, 40, 30}}};
  const double place = share > 0 ? std::min(share, 1.0) * (kStops.size() - 1) : 0;
  const std::size_t first = std::min(static_cast<std::size_t>(place), kStops.size() - 2);
  const double u = place - static_cast<double>(first);
  std::array<std::uint8_t, 3> color{};
  for (std::size_t c = 0; c < 3; ++c) {
    color[c] = static_cast<std::uint8_t>(
        std::lround((1 - u) * kStops[first][c] + u * kStops[first + 1][c]));
  }
  return color;
}

InverseDepthSpan inverse_depth_span(std::span<const float> z) {
  constexpr std::size_t kMaxSamples = 20'000;
  const std::size_t step = z.size() / kMaxSamples + 1;
  std::vector<double> inverse;
  for (std::size_t i = 0; i < z.size(); i += step) {
    if (std::isfinite(z[i]) && z[i] > 0) inverse.push_back(1.0 / z[i]);
  }
  if (inverse.empty()) return {};
  const auto percentile = [&](double share) {
    const auto place =
        inverse.begin() + std::lround(share * static_cast<double>(inverse.size() - 1));
    std::nth_element(inverse.begin(), place, inverse.end());
    return *place;
  };
  InverseDepthSpan span{percentile(0.01), percentile(0.99)};
  // A plane gets the middle of the colours.
  constexpr double kSmallestSpan = 1e-6;
  if (span.near - span.far < kSmallestSpan)
    span = {span.far - kSmallestSpan, span.near + kSmallestSpan};
  return span;
}

void show_depth(std::span<const float> z, const InverseDepthSpan& span,
                std::span<std::uint8_t> codes) {
  constexpr std::array<std::uint8_t, 3> kWithoutDepth{24, 24, 24};
  for (std::size_t x = 0; x < z.size(); ++x) {
    const double share = (1 / static_cast<double>(z[x]) - span.far) / (span.near - span.far);
    const auto color = std::isfinite(z[x]) ? false_color(share) : kWithoutDepth;
    std::ranges::copy(color, &codes[3 * x]);
  }
}

}  // namespace raystage::compose
