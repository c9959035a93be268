// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "calibrate/geometry/array_model.h"

namespace raystage {

/// Returns the share of used points whose observations in two cameras one homography explains, to
/// 1.5 pixels: they are in one plane or far away. 0 unless exactly two cameras have a pose: with
/// more, a plane of points is no degenerate case (Ma et al. 2004, section 5.3).
double planar_inlier_ratio(const ArrayModel& model);

}  // namespace raystage
