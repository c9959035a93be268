// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>

namespace raystage {

/// Returns the linear light of an sRGB code value (IEC 61966-2-1), both with full scale 1.
inline double linear_from_srgb(double code) {
  return code <= 0.04045 ? code / 12.92 : std::pow((code + 0.055) / 1.055, 2.4);
}

/// Returns the inverse of linear_from_srgb(). The same formulas extend it outside [0, 1].
inline double srgb_from_linear(double linear) {
  return linear <= 0.0031308 ? linear * 12.92 : 1.055 * std::pow(linear, 1 / 2.4) - 0.055;
}

}  // namespace raystage
