// SPDX-License-Identifier: Apache-2.0
// Internal to rig_formats/.
#pragma once

#include "schemas/geometry.h"

namespace raystage::ingest {

/// A fisheye that approximates a lens of the FOV model.
struct FovApproximation {
  schemas::Intrinsics intrinsics;
  double max_error_px = 0;  ///< largest distance of two pixels of one ray within the picture
};

/// Returns the fisheye nearest to the FOV model (Devernay and Faugeras, 2001): the distance of a
/// ray at angle a, in focal lengths, is atan(2 tan(a) tan(omega / 2)) / omega. fx, fy, cx and cy
/// are those of the FOV model, pixels; |omega| < pi, radians. The error is infinite if there is no
/// fisheye that reaches the corners of the picture.
FovApproximation approximate_fov_lens(double fx, double fy, double cx, double cy, double omega,
                                      int width, int height);

}  // namespace raystage::ingest
