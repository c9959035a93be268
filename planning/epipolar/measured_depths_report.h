// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "planning/epipolar/measured_depths.h"

namespace raystage::planning {

/// Returns the depths for people, as JSON, or as one self-contained HTML page with the
/// epipolar-plane images.
std::string format_measured_depths(const MeasuredDepths& depths);
std::string measured_depths_as_json(const MeasuredDepths& depths);
std::string measured_depths_as_page(const MeasuredDepths& depths);

}  // namespace raystage::planning
