// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

#include "calibrate/color/flat_field_measurement.h"

namespace raystage {

struct VignettingFit {
  Vignetting lens;
  double residual = 0;  ///< RMS residual, relative to the light in the centre
};

/// Fits the vignetting model to the picture of an evenly lit target, by robust non-linear least
/// squares (Ceres) over the cells. `response`: contrast and brightness of the camera. Cells with
/// dust or shadows get a low weight.
VignettingFit fit_vignetting(std::span<const FlatFieldCell> cells, PictureSize size,
                             const PhotometricResponse& response);

/// Returns the mean transmission of vignetting and gain map over the area of
/// FlatFieldMeasurement::mean.
Rgb mean_centre_transmission(const PhotometricResponse& response, PictureSize size);

}  // namespace raystage
