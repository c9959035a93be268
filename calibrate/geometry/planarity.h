// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "calibrate/geometry/array_model.h"

namespace raystage {

/// Share of the points that count for which one plane, or distance, explains where two cameras saw
/// them (a homography between the pictures, to a pixel and a half). 0 unless exactly two cameras
/// are found: of more, a plane of points leaves nothing open (Ma et al. 2004, section 5.3).
double planar_inlier_ratio(const ArrayModel& model);

}  // namespace raystage
