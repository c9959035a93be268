// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "schemas/rig_document.h"

namespace raystage::calibrate {

/// Differences of two rigs after the second was aligned with the first by a similarity (least
/// squares over the centres of all common cameras).
struct RigComparison {
  struct Camera {
    std::string id;
    double position_m = 0;    ///< distance of the centres, metres of the first rig
    double rotation_deg = 0;  ///< angle between the rotations
    double rms_px = 0;        ///< RMS distance between the projections of common points
    double max_px = 0;        ///< largest; NaN, as rms_px, if no point is visible to both
    double focal_ratio = 1;   ///< focal length of the second relative to the first
  };
  std::vector<Camera> cameras;
  std::vector<std::string> only_in_first, only_in_second;
  double scale = 1;  ///< metres of the first rig per metre of the second
};

/// Compares two rigs. Pixel differences are computed on a 9x9 grid of pixels of the first rig's
/// camera. Their points are at `nearest_m` metres (0: ten times the median distance between
/// neighbours), twice and four times as far, and at infinity. Throws Error (bad input) if fewer
/// than two cameras are common.
RigComparison compare_rigs(const schemas::RigDocument& first, const schemas::RigDocument& second,
                           double nearest_m);

std::string format_rig_comparison(const RigComparison& comparison);
std::string rig_comparison_json(const RigComparison& comparison);

}  // namespace raystage::calibrate
