// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "calibrate/flat_sight.h"

namespace raystage {

struct FlatColorSettings {
  int reference = 0;        ///< camera that the others are made alike to
  bool neutral = false;     ///< and makes the brightest target grey
  bool vignetting = false;  ///< the brightest target fills every picture, and is as bright there
  std::vector<PhotometricResponse> curves{};  ///< of each camera, whose curves the sights went by
  bool dark = false;  ///< the darkest target has no light: lenses are capped
};

/// How well cameras agree about targets, before and after.
struct ColorSpread {
  Rgb deviation{};  ///< of the cameras' means about their mean, by it: the worst target's
  double mean_difference = 0;  ///< CIEDE2000 from the reference camera, over cameras and targets
  double most_difference = 0;
};

struct FlatColors {
  std::vector<PhotometricResponse> responses;  ///< of each camera
  ColorSpread before, after;
  double worst_vignetting = 0;  ///< what the model leaves of a target: root mean square, by it
  std::vector<std::string> reasons, warnings;  ///< why it cannot be vouched for; what is weak
};

/// Contrast and brightness of each camera and channel against a reference camera (thesis 4.3, eq.
/// 4.1), by least squares over targets of different brightness (lens caps, grey, white): `targets`
/// by take. Blacks that are cut off at code 0 tell nothing. One target tells the contrast alone.
/// On request vignetting, from the brightest target; and where one is dark, light from the
/// reference camera's black on, and the pixels that stand out in the dark.
/// Throws Error (bad input) where a camera sees no light.
FlatColors match_flat_targets(const std::vector<FlatSights>& targets,
                              const std::vector<std::string>& cameras,
                              const FlatColorSettings& settings);

std::string color_text(const FlatColors& colors, const std::string& reference);

}  // namespace raystage
