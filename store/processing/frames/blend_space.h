// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cmath>

#include "base/transfer_function.h"

namespace raystage::store {

/// The scale on which the samples of several cameras for one ray are averaged. The result is linear
/// light.
enum class BlendSpace {
  /// The sRGB curve. Where the samples disagree (off the focal surface), their mean on a
  /// perceptually uniform scale is the better estimate: docs/decisions.md has figures.
  kPerceptual,
  /// Linear light, as a lens averages the rays in its aperture.
  kLinear,
  /// The power 1/2.4 of light relative to full scale: near the sRGB curve, and alike at every full
  /// scale. FrameCache takes it instead of kPerceptual for takes with light above white.
  kHighRange
};

/// Returns the part of full scale, 0 to 1, of a value on the scale of `space`.
inline double part_from_value(BlendSpace space, double value) {
  if (space == BlendSpace::kPerceptual) return linear_from_srgb(value);
  return space == BlendSpace::kLinear ? value : std::pow(std::max(0.0, value), 2.4);
}
/// Inverts part_from_value().
inline double value_from_part(BlendSpace space, double part) {
  if (space == BlendSpace::kPerceptual) return srgb_from_linear(part);
  return space == BlendSpace::kLinear ? part : std::pow(std::max(0.0, part), 1 / 2.4);
}

}  // namespace raystage::store
