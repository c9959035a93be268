// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "schemas/photometric_response.h"

namespace raystage::rig {

/// The size of a camera's picture in pixels.
struct PictureSize {
  int width = 0, height = 0;
};

/// Returns the corrected code, full scale 1, by one channel of PhotometricResponse::curve.
double evaluate_response_curve(const std::vector<double>& curve, double code);
/// Returns the code, 0 to 1, whose corrected value is `corrected`.
double invert_response_curve(const std::vector<double>& curve, double corrected);

/// Returns the gain on light per channel at (x, y) pixels from the top left: vignetting * gain map.
schemas::Rgb gain_at(const schemas::PhotometricResponse& response, PictureSize size, double x,
                     double y);

/// Returns the light that a reference camera would have recorded (thesis eq. 4.1) if this camera
/// recorded `shown` at pixel (x, y), without replacing hot pixels. Both are linear light after the
/// curve, full scale 1; the result may exceed [0, 1]. `dark`: the pixel's light in the dark frame.
schemas::Rgb apply_photometric_correction(const schemas::PhotometricResponse& response,
                                          PictureSize size, int x, int y, const schemas::Rgb& shown,
                                          const schemas::Rgb& dark = {});
/// Inverts apply_photometric_correction(). Throws Error (bad input) for a singular colour matrix.
schemas::Rgb invert_photometric_correction(const schemas::PhotometricResponse& response,
                                           PictureSize size, int x, int y,
                                           const schemas::Rgb& light,
                                           const schemas::Rgb& dark = {});

/// Returns matrix * color.
schemas::Rgb multiply(const schemas::ColorMatrix& matrix, const schemas::Rgb& color);
/// Returns the inverse matrix. Throws Error (bad input) if `matrix` is singular.
schemas::ColorMatrix inverse(const schemas::ColorMatrix& matrix);

}  // namespace raystage::rig
