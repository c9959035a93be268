// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "testing/render/extremes.h"

namespace raystage::testing {

/// The largest errors of a view's geometry against 50 digits, over its pixels.
struct GeometryErrors {
  double weight = 0;      ///< of a camera in its cell
  double position = 0;    ///< where a camera is sampled, pixels of an image 960 wide
  double depth = 0;       ///< relative
  double weight_sum = 0;  ///< how far a pixel's weights are from 1 in all
  int weights_compared = 0, positions_compared = 0;
};

/// The same view in double (RayCells, PlaneProjection, CameraModel) and by the kernels.
struct ViewAccuracy {
  GeometryErrors in_double, in_kernels;
};

/// Looks at some 500 pixels, through 9 cameras or fewer of 960 x 720 with lens distortion.
/// The kernels run on the instruction set that is chosen at the time.
ViewAccuracy measure_accuracy(const ExtremeView& extreme);

}  // namespace raystage::testing
