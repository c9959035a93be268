// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace raystage {

/// On what scale several cameras' samples of one ray are averaged. The result is linear light.
enum class BlendSpace {
  /// sRGB's curve. The samples are several estimates of one ray, and where they disagree (off the
  /// focal surface) their mean on a scale of even steps to the eye is the better one: see
  /// docs/decisions.md for figures.
  kPerceptual,
  /// Linear light: what a lens does that gathers several rays.
  kLinear
};

}  // namespace raystage
