// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>

#include "schemas/matte_settings.h"

namespace raystage::store {

/// Linear light R, G, B.
using LinearColour = std::array<float, 3>;

/// The premultiplied foreground colour and the alpha of a pixel.
struct KeyedPixel {
  LinearColour colour{};
  float alpha = 0;
};

/// Colour difference keyer (Vlahos, US patent 3,158,477; Smith and Blinn, "Blue screen matting",
/// SIGGRAPH 1996). The screen's share of a pixel is the pixel's excess of the screen's primary over
/// the other primaries, divided by the screen's excess. That share of the screen's light is
/// subtracted. Works in linear light, in which a partly covered pixel is a linear mix.
class ColorDifferenceKeyer {
 public:
  explicit ColorDifferenceKeyer(const schemas::MatteSettings& settings);

  /// Returns the screen's primary of a colour minus its companion; above 0 for the screen.
  float excess(const LinearColour& colour) const;
  /// Returns the excess divided by the primary: equal in lit and shaded parts of a screen.
  float relative_excess(const LinearColour& colour) const;
  /// Returns the foreground and alpha of `colour` in front of `screen`.
  KeyedPixel operator()(const LinearColour& colour, const LinearColour& screen) const;

 private:
  /// Returns the primary that a colour without excess has: a mix of the other two.
  float companion(const LinearColour& colour) const;

  std::size_t primary_, second_, third_;
  float balance_, despill_, black_, per_range_;
};

/// Difference keyer: alpha rises with the RMS difference of the pixel's codes from the clean
/// plate's.
class DifferenceKeyer {
 public:
  explicit DifferenceKeyer(const schemas::MatteSettings& settings);

  /// Returns the foreground and alpha of a pixel. `empty`: linear light of the clean plate.
  /// `codes`, `empty_codes`: both colours on the sRGB curve, full scale 1.
  KeyedPixel operator()(const LinearColour& colour, const LinearColour& codes,
                        const LinearColour& empty, const LinearColour& empty_codes) const;

 private:
  float low_, per_range_;
};

}  // namespace raystage::store
