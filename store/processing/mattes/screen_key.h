// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>

#include "schemas/matte_settings.h"

namespace raystage {

/// Linear light R, G, B.
using LinearColour = std::array<float, 3>;

/// A pixel taken apart: premultiplied foreground, and alpha.
struct KeyedPixel {
  LinearColour colour{};
  float alpha = 0;
};

/// Colour difference keyer (Vlahos, US patent 3,158,477; Smith and Blinn, "Blue screen matting",
/// SIGGRAPH 1996): what a pixel has of the screen's primary beyond the others, against what the
/// screen has, is the screen's share in it. That share of the screen's light is taken off. All in
/// linear light, where a pixel half covered is half the sum.
class ScreenKey {
 public:
  explicit ScreenKey(const MatteSettings& settings);

  /// How much more of its primary a colour has than of the others; the screen's must be above 0.
  float excess(const LinearColour& colour) const;
  /// That, of the primary itself: the same in a screen's light and shade.
  float purity(const LinearColour& colour) const;
  KeyedPixel operator()(const LinearColour& colour, const LinearColour& screen) const;

 private:
  /// How much of the primary goes with the others.
  float companion(const LinearColour& colour) const;

  std::size_t primary_, second_, third_;
  float balance_, despill_, black_, per_range_;
};

/// How far a pixel is from the empty set's, as the mean distance of its codes, says how opaque it
/// is.
class DifferenceKey {
 public:
  explicit DifferenceKey(const MatteSettings& settings);

  /// `codes`, `empty_codes`: of sRGB's curve, full scale 1.
  KeyedPixel operator()(const LinearColour& colour, const LinearColour& codes,
                        const LinearColour& empty, const LinearColour& empty_codes) const;

 private:
  float low_, per_range_;
};

}  // namespace raystage
