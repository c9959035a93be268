// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "schemas/photometric_response.h"

namespace raystage {

/// The size of a camera's picture in pixels.
struct PictureSize {
  int width = 0, height = 0;
};

/// Returns the corrected code, full scale 1, by one channel of PhotometricResponse::curve.
double evaluate_response_curve(const std::vector<double>& curve, double code);
/// Returns the code, 0 to 1, whose corrected value is `corrected`.
double invert_response_curve(const std::vector<double>& curve, double corrected);

/// Returns the gain on light, per channel, at (x, y) pixels from the picture's
/// top-left corner: vignetting times gain map.
Rgb gain_at(const PhotometricResponse& response, PictureSize size, double x, double y);

/// Returns the light that a reference camera would have recorded (thesis eq. 4.1) if this camera
/// recorded `shown` at pixel (x, y). Both are linear light after the curve, full scale 1; the
/// result may be below 0 or above 1. `dark` is the pixel's light in the dark frame. Hot pixels are
/// not replaced here.
Rgb apply_photometric_correction(const PhotometricResponse& response, PictureSize size, int x,
                                 int y, const Rgb& shown, const Rgb& dark = {});
/// Returns the inverse of apply_photometric_correction(). Throws Error (bad input) if the colour
/// matrix is singular.
Rgb invert_photometric_correction(const PhotometricResponse& response, PictureSize size, int x,
                                  int y, const Rgb& light, const Rgb& dark = {});

Rgb multiply(const ColorMatrix& matrix, const Rgb& color);
/// Returns the inverse matrix. Throws Error (bad input) if `matrix` is singular.
ColorMatrix inverse(const ColorMatrix& matrix);

}  // namespace raystage
