// SPDX-License-Identifier: Apache-2.0
// Errors of a view in linear light, for takes of more than 8 bits. The mean square of linear light
// would be that of the brightest lamp alone; PU21 codes are spaced as the eye resolves light on a
// bright display, so that shadows and highlights both count. Cost: O(pixels).
#include "evaluation/light_errors.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace raystage::evaluation {
namespace {

constexpr double kNotANumber = std::numeric_limits<double>::quiet_NaN();

/// Returns the mean of the finite values that `value` gives.
template <class Value>
double mean_of_finite(std::span<const LightErrors> views, const Value& value) {
  double sum = 0, count = 0;
  for (const LightErrors& view : views) {
    if (!std::isfinite(value(view))) continue;
    sum += value(view);
    ++count;
  }
  return count > 0 ? sum / count : kNotANumber;
}

}  // namespace

double pu21_code(double light) {
  constexpr double kWhite = 203, kDarkest = 0.005, kBrightest = 10000;  // cd/m2
  constexpr double kP1 = 0.353487901, kP2 = 0.3734658629, kP3 = 8.277049286e-05, kP4 = 0.9062562627,
                   kP5 = 0.09150303166, kP6 = 0.9099517204, kP7 = 596.3148142;
  const double power = std::pow(std::clamp(kWhite * light, kDarkest, kBrightest), kP4);
  return std::max(0.0, kP7 * (std::pow((kP1 + kP2 * power) / (1 + kP3 * power), kP5) - kP6));
}

LightErrors light_errors(const render::RenderedView& view, std::span<const float> truth,
                         std::span<const std::uint8_t> covered) {
  // Light that is black on any display: limits the ratio where nothing was found.
  constexpr double kBlack = 1.0 / 1024;
  double squares = 0, samples = 0, stops = 0, bright = 0, pixels = 0, bright_pixels = 0;
  for (std::size_t i = 0; i < covered.size(); ++i) {
    if (covered[i] == 0) continue;
    const double alpha = view.rgba[4 * i + 3];
    bool is_bright = false;
    for (std::size_t c = 0; c < 3; ++c) {
      const double wanted = truth[3 * i + c], found = view.rgba[4 * i + c] / alpha;
      const double difference = pu21_code(found) - pu21_code(wanted);
      squares += difference * difference;
      ++samples;
      if (!(wanted > 1)) continue;
      const double ratio = std::log2(std::max(found, kBlack) / wanted);
      stops += ratio * ratio;
      ++bright;
      is_bright = true;
    }
    ++pixels;
    bright_pixels += is_bright ? 1 : 0;
  }
  constexpr double kPeak = 256;
  if (pixels == 0) return {kNotANumber, 0, kNotANumber};
  return {10 * std::log10(kPeak * kPeak * samples / squares), bright_pixels / pixels,
          bright > 0 ? std::sqrt(stops / bright) : kNotANumber};
}

LightErrors mean_light_errors(std::span<const LightErrors> views) {
  return {mean_of_finite(views, [](const LightErrors& view) { return view.pu_psnr_db; }),
          mean_of_finite(views, [](const LightErrors& view) { return view.highlight_share; }),
          mean_of_finite(views, [](const LightErrors& view) { return view.highlight_rms_stops; })};
}

}  // namespace raystage::evaluation
