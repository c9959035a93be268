// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "calibrate/geometry/array_model.h"

namespace raystage::calibrate {

/// Triangulates the undetermined points that at least two registered cameras observe, by the
/// nearest points of their rays; not if the rays are almost parallel.
void triangulate_points(ArrayModel& model, double max_error_px);

}  // namespace raystage::calibrate
