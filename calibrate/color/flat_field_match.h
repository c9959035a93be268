// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "calibrate/color/color_match.h"
#include "calibrate/color/flat_field_measurement.h"

namespace raystage {

struct FlatFieldMatchSettings {
  int reference = 0;        ///< camera that the others are made alike to
  bool neutral = false;     ///< and makes the brightest target grey
  bool vignetting = false;  ///< the brightest target fills every picture, and is as bright there
  bool flat_field = false;  ///< likewise, and whatever is not the lens' (or all) becomes a gain map
  std::vector<PhotometricResponse>
      curves{};       ///< of each camera, whose curves the measurements went by
  bool dark = false;  ///< the last target has no light: lenses are capped
};

struct FlatFieldMatch : ColorMatch {
  double worst_vignetting = 0;  ///< what the model leaves of a target: root mean square, by it
};

/// Contrast and brightness of each camera and channel against a reference camera (thesis 4.3, eq.
/// 4.1), by least squares over targets of different brightness (lens caps, grey, white): `targets`
/// by take. Blacks that are cut off at code 0 tell nothing. One target tells the contrast alone.
/// On request vignetting and a gain map, from the brightest target; and where one is dark, light
/// from the reference camera's black on, and the pixels that stand out in the dark. Throws Error
/// (bad input) where a camera sees no light.
FlatFieldMatch match_flat_fields(const std::vector<FlatFieldMeasurements>& targets,
                                 const std::vector<std::string>& cameras,
                                 const FlatFieldMatchSettings& settings);

}  // namespace raystage
