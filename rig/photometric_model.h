// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "schemas/photometric_response.h"

namespace raystage {

/// A camera's picture, pixels.
struct PictureSize {
  int width = 0, height = 0;
};

/// What a code ought to be, both full scale 1, by one channel of PhotometricResponse::curve.
double evaluate_response_curve(const std::vector<double>& curve, double code);
/// Its inverse, 0 to 1: the code that ought to be `straight`.
double invert_response_curve(const std::vector<double>& curve, double straight);

/// The factor by which light is brightened, per channel, at (x, y) pixels from the picture's
/// top-left corner: vignetting times gain map.
Rgb gain_at(const PhotometricResponse& response, PictureSize size, double x, double y);

/// The light that a reference camera would have shown (thesis eq. 4.1) where this one shows
/// `shown` at pixel (x, y): after the curve, linear, full scale 1; may be below 0 or above 1.
/// `dark`: what the pixel shows in the dark. Pixels that are shown as their neighbours are not
/// told from others here.
Rgb apply_photometric_correction(const PhotometricResponse& response, PictureSize size, int x,
                                 int y, const Rgb& shown, const Rgb& dark = {});
/// Its inverse. Throws Error (bad input) where the colour matrix has none.
Rgb invert_photometric_correction(const PhotometricResponse& response, PictureSize size, int x,
                                  int y, const Rgb& light, const Rgb& dark = {});

Rgb multiply(const ColorMatrix& matrix, const Rgb& color);
/// Throws Error (bad input) where there is none.
ColorMatrix inverse(const ColorMatrix& matrix);

}  // namespace raystage
