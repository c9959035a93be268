// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <string>
#include <vector>

#include "calibrate/color/flat_field_measurement.h"

namespace raystage::calibrate {

/// Code of one channel at a location of a static target at one exposure.
struct ResponseSample {
  int location = 0;     ///< counted from 0
  double exposure = 0;  ///< relative; 0: no light
  double code = 0;      ///< full scale 1
};

/// Returns a response curve (one channel of PhotometricResponse::curve) that makes light
/// proportional to exposure. Method: non-linear least squares over the curve and the light of the
/// locations, with a smoothness term. It follows Debevec and Malik, "Recovering high dynamic range
/// radiance maps from photographs", SIGGRAPH 1997. Black and full scale are fixed, because
/// exposures do not determine contrast and brightness. With samples of exposure 0 the dark level is
/// estimated, too. Throws Error (bad input) if fewer than two exposures have usable codes.
std::vector<double> fit_response_curve(std::span<const ResponseSample> codes,
                                       const std::string& color_space);

/// Returns the curves of every camera from measurements of one target at each of `exposures`, and
/// in the dark unless `dark` is null.
std::vector<schemas::PhotometricResponse> fit_response_curves(
    const std::vector<FlatFieldMeasurements>& measurements, std::span<const double> exposures,
    const FlatFieldMeasurements* dark, const std::string& color_space);

}  // namespace raystage::calibrate
