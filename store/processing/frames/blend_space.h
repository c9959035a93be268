// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace raystage::store {

/// The scale on which the samples of several cameras for one ray are averaged. The result is linear
/// light.
enum class BlendSpace {
  /// The sRGB curve. Where the samples disagree (off the focal surface), their mean on a
  /// perceptually uniform scale is the better estimate: docs/decisions.md has figures.
  kPerceptual,
  /// Linear light, as a lens averages the rays in its aperture.
  kLinear
};

}  // namespace raystage::store
