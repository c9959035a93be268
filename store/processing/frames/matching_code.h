// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cmath>

#include "base/transfer_function.h"
#include "store/processing/frames/frame_matte.h"

namespace raystage::store {

/// Returns the code, 0 to 1, in which methods compare the light of frames on a scale of
/// BlendSpace::kHighRange. Up to white it is four fifths of the sRGB curve, so that dark tones are
/// told apart as in takes of 8 bits; the rest is the logarithm of light up to full scale.
inline double matching_code(const CodeScale& scale, double light) {
  constexpr double kWhite = 0.8;
  if (light <= 1) return kWhite * srgb_from_linear(std::max(light, 0.0));
  const double part = std::log(light) / std::log(std::max(scale.full_scale, 1.001));
  return kWhite + (1 - kWhite) * std::min(part, 1.0);
}

}  // namespace raystage::store
