// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

#include "calibrate/flat_sight.h"

namespace raystage {

struct FoundVignetting {
  Vignetting lens;
  double residual = 0;  ///< root mean square of what is left, by the light in the middle
};

/// The fall of light that makes a target everywhere as bright, by non-linear least squares (Ceres)
/// over the cells of a picture; `response`: contrast and brightness of the camera. Cells with
/// something on them (dust, a shadow) weigh little.
FoundVignetting find_vignetting(std::span<const FlatCell> cells, PictureSize size,
                                const PhotometricResponse& response);

/// The mean share of light that vignetting and gain map leave over the middle of the picture that
/// FlatSight::mean is of.
Rgb left_in_middle(const PhotometricResponse& response, PictureSize size);

}  // namespace raystage
