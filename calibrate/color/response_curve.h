// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <string>
#include <vector>

#include "calibrate/color/flat_field_measurement.h"

namespace raystage {

/// A location of an unmoving target as a channel shows it at one exposure.
struct ResponseSample {
  int location = 0;     ///< counted from 0
  double exposure = 0;  ///< relative; 0: no light
  double code = 0;      ///< full scale 1
};

/// What codes ought to be (one channel of PhotometricResponse::curve), so that light follows
/// exposure: by non-linear least squares over the curve and the places' light (after Debevec and
/// Malik, Recovering high dynamic range radiance maps from photographs, 1997), smooth where nothing
/// was shown. Black stays black and full scale full scale: contrast and brightness, which exposures
/// do not tell, make up for both. What is shown without light is found with it where `codes` hold
/// exposure 0. Throws Error (bad input) where
/// fewer than two exposures show anything.
std::vector<double> fit_response_curve(std::span<const ResponseSample> codes,
                                       const std::string& color_space);

/// The curves of every camera, from measurements of one target at each of `exposures`, and in the
/// dark where `dark` is not null.
std::vector<PhotometricResponse> fit_response_curves(
    const std::vector<FlatFieldMeasurements>& measurements, std::span<const double> exposures,
    const FlatFieldMeasurements* dark, const std::string& color_space);

}  // namespace raystage
