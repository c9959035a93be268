// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "calibrate/color/color_match.h"
#include "calibrate/color/flat_field_measurement.h"

namespace raystage::calibrate {

struct FlatFieldMatchOptions {
  int reference = 0;     ///< camera that the others are matched to
  bool neutral = false;  ///< also makes the brightest target grey
  /// fits the vignetting: the brightest target fills every picture evenly
  bool vignetting = false;
  bool flat_field = false;  ///< also fits a gain map to the residuals of the vignetting model
  /// responses with the curves that were used in the measurements
  std::vector<schemas::PhotometricResponse> curves{};
  bool dark = false;  ///< the last target is dark: lens caps
};

struct FlatFieldMatch : ColorMatch {
  double worst_vignetting = 0;  ///< RMS residual of the vignetting model, relative
};

/// Returns contrast and brightness of each camera and channel relative to a reference camera
/// (thesis 4.3, eq. 4.1). Method: least squares over targets of different brightness (lens caps,
/// grey, white). `targets`: one entry per take. Black levels that are clipped at code 0 are
/// ignored. One target determines the contrast only. On request it fits vignetting and a gain map
/// to the brightest target; a dark target gives the reference camera's black level and the hot
/// pixels. Throws Error (bad input) if a camera sees no light.
FlatFieldMatch match_flat_fields(const std::vector<FlatFieldMeasurements>& targets,
                                 const std::vector<std::string>& cameras,
                                 const FlatFieldMatchOptions& options);

}  // namespace raystage::calibrate
