// SPDX-License-Identifier: Apache-2.0
// Keys single pixels. Colour difference: alpha = 1 - excess(pixel) / excess(screen), stretched from
// [black, white] to [0, 1]. The screen's share is subtracted and spill suppressed (Vlahos, US
// patent 3,158,477; Smith and Blinn, SIGGRAPH 1996). Difference: alpha from the RMS difference of
// codes. Input: linear R, G, B. Output: premultiplied R, G, B and alpha. Cost: constant per pixel.
#include "store/processing/mattes/keyers.h"

#include <algorithm>
#include <cmath>

namespace raystage::store {

ColorDifferenceKeyer::ColorDifferenceKeyer(const schemas::MatteSettings& settings)
    : primary_(settings.kind == schemas::MatteSettings::Kind::kGreenScreen ? 1 : 2),
      second_(0),
      third_(3 - primary_),
      balance_(static_cast<float>(settings.balance)),
      despill_(static_cast<float>(settings.despill)),
      black_(static_cast<float>(settings.black)),
      per_range_(static_cast<float>(1 / std::max(1e-6, settings.white - settings.black))) {}

float ColorDifferenceKeyer::companion(const LinearColour& colour) const {
  const auto [less, more] = std::minmax(colour[second_], colour[third_]);
  return less + balance_ * (more - less);
}

float ColorDifferenceKeyer::excess(const LinearColour& colour) const {
  return colour[primary_] - companion(colour);
}

float ColorDifferenceKeyer::relative_excess(const LinearColour& colour) const {
  return excess(colour) / std::max(1e-6F, colour[primary_]);
}

KeyedPixel ColorDifferenceKeyer::operator()(const LinearColour& colour,
                                            const LinearColour& screen) const {
  const float share = excess(colour) / excess(screen);
  KeyedPixel keyed{colour, std::clamp((1 - share - black_) * per_range_, 0.0F, 1.0F)};
  if (keyed.alpha == 0) return {};
  const float screen_share = std::clamp(share, 0.0F, 1.0F);
  for (std::size_t c = 0; c < 3; ++c) {
    keyed.colour[c] = std::max(0.0F, colour[c] - screen_share * screen[c]);
  }
  const float spill = std::max(0.0F, excess(keyed.colour));
  keyed.colour[primary_] -= despill_ * spill;
  return keyed;
}

DifferenceKeyer::DifferenceKeyer(const schemas::MatteSettings& settings)
    : low_(static_cast<float>(settings.low / 255)),
      per_range_(static_cast<float>(255 / std::max(1e-6, settings.high - settings.low))) {}

KeyedPixel DifferenceKeyer::operator()(const LinearColour& colour, const LinearColour& codes,
                                       const LinearColour& empty,
                                       const LinearColour& empty_codes) const {
  float square = 0;
  for (std::size_t c = 0; c < 3; ++c) {
    square += (codes[c] - empty_codes[c]) * (codes[c] - empty_codes[c]) / 3;
  }
  KeyedPixel keyed{colour, std::clamp((std::sqrt(square) - low_) * per_range_, 0.0F, 1.0F)};
  if (keyed.alpha == 0) return {};
  for (std::size_t c = 0; c < 3; ++c) {
    keyed.colour[c] = std::max(0.0F, colour[c] - (1 - keyed.alpha) * empty[c]);
  }
  return keyed;
}

}  // namespace raystage::store
