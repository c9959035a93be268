// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

#include "calibrate/color/flat_field_measurement.h"

namespace raystage {

struct VignettingFit {
  Vignetting lens;
  double residual = 0;  ///< root mean square of what is left, by the light in the middle
};

/// The fall of light that makes a target everywhere as bright, by non-linear least squares (Ceres)
/// over the cells of a picture; `response`: contrast and brightness of the camera. Cells with
/// something on them (dust, a shadow) weigh little.
VignettingFit fit_vignetting(std::span<const FlatFieldCell> cells, PictureSize size,
                             const PhotometricResponse& response);

/// The mean share of light that vignetting and gain map leave over the middle of the picture that
/// FlatFieldMeasurement::mean is of.
Rgb mean_centre_transmission(const PhotometricResponse& response, PictureSize size);

}  // namespace raystage
