// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

#include "calibrate/color/flat_field_measurement.h"

namespace raystage::calibrate {

struct VignettingFit {
  schemas::Vignetting lens;
  double residual = 0;  ///< RMS residual, relative to the light in the centre
};

/// Fits the vignetting model to the picture of an evenly lit target, by robust non-linear least
/// squares (Ceres) over the cells. `response`: contrast and brightness of the camera. Cells with
/// dust or shadows get a low weight.
VignettingFit fit_vignetting(std::span<const FlatFieldCell> cells, rig::PictureSize size,
                             const schemas::PhotometricResponse& response);

/// Returns the mean transmission of vignetting and gain map over the area of
/// FlatFieldMeasurement::mean.
schemas::Rgb mean_centre_transmission(const schemas::PhotometricResponse& response,
                                      rig::PictureSize size);

}  // namespace raystage::calibrate
