// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "testing/render/extremes.h"

namespace raystage::testing {

/// The largest errors of a view's geometry over its pixels, compared with 50 digits.
struct GeometryErrors {
  double weight = 0;      ///< of a camera in its cell
  double position = 0;    ///< of a sample in a camera's image 960 pixels wide, pixels
  double depth = 0;       ///< relative
  double weight_sum = 0;  ///< difference of the sum of a pixel's weights from 1
  int weights_compared = 0, positions_compared = 0;
};

/// Errors of the same view in double (RayCells, PlaneProjection, CameraModel) and in the kernels.
struct ViewAccuracy {
  GeometryErrors in_double, in_kernels;
};

/// Measures about 500 pixels with at most 9 cameras of 960 x 720 with lens distortion. The kernels
/// use the current instruction set.
ViewAccuracy measure_accuracy(const ExtremeView& extreme);

}  // namespace raystage::testing
