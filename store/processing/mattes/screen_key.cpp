// SPDX-License-Identifier: Apache-2.0
#include "store/processing/mattes/screen_key.h"

#include <algorithm>
#include <cmath>

namespace raystage {

ScreenKey::ScreenKey(const MatteSettings& settings)
    : primary_(settings.kind == MatteSettings::Kind::kGreenScreen ? 1 : 2),
      second_(0),
      third_(3 - primary_),
      balance_(static_cast<float>(settings.balance)),
      despill_(static_cast<float>(settings.despill)),
      black_(static_cast<float>(settings.black)),
      per_range_(static_cast<float>(1 / std::max(1e-6, settings.white - settings.black))) {}

float ScreenKey::companion(const LinearColour& colour) const {
  const auto [less, more] = std::minmax(colour[second_], colour[third_]);
  return less + balance_ * (more - less);
}

float ScreenKey::excess(const LinearColour& colour) const {
  return colour[primary_] - companion(colour);
}

float ScreenKey::purity(const LinearColour& colour) const {
  return excess(colour) / std::max(1e-6F, colour[primary_]);
}

KeyedPixel ScreenKey::operator()(const LinearColour& colour, const LinearColour& screen) const {
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

DifferenceKey::DifferenceKey(const MatteSettings& settings)
    : low_(static_cast<float>(settings.low / 255)),
      per_range_(static_cast<float>(255 / std::max(1e-6, settings.high - settings.low))) {}

KeyedPixel DifferenceKey::operator()(const LinearColour& colour, const LinearColour& codes,
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

}  // namespace raystage
