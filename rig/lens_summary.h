// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "rig/rig.h"

namespace raystage::rig {

/// Cameras with one projection.
struct LensSummary {
  schemas::Projection projection = schemas::Projection::kPinhole;
  int cameras = 0;
  /// Smallest and largest field of view, degrees: of pinholes from the left to the right edge of
  /// the picture without distortion, of fisheyes across the whole circle, as far as the lens and
  /// the corners of the picture reach.
  double min_fov_deg = 0, max_fov_deg = 0;
};

/// Returns the largest angle to the axis of a ray in a fisheye's picture, radians, as far as the
/// lens and the corners of the picture reach.
double recorded_half_angle(const CameraModel& fisheye);

/// Returns the lenses of a rig, the most frequent projection first.
std::vector<LensSummary> summarise_lenses(const Rig& rig);

/// Returns the name of a projection in texts: "f-theta".
const char* projection_title(schemas::Projection projection);

/// Returns "f-theta, 180 degrees", or "12 f-theta, 180 degrees; 4 pinhole, 53.1 to 61.9 degrees".
std::string format_lenses(const std::vector<LensSummary>& lenses);

}  // namespace raystage::rig
