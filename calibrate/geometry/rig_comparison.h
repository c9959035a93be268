// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "schemas/rig_document.h"

namespace raystage {

/// How two rigs of the same cameras differ, once the second is brought over the first: by a
/// rotation, a scale and a translation (least squares over the centres of all common cameras).
struct RigComparison {
  struct Camera {
    std::string id;
    double position_m = 0;    ///< between the centres, metres of the first rig
    double rotation_deg = 0;  ///< of the rotation from one to the other
    double rms_px = 0;        ///< between where both would see the same points
    double max_px = 0;        ///< NaN, as rms_px: one sees none of them
    double focal_ratio = 1;   ///< the second's focal length by the first's
  };
  std::vector<Camera> cameras;
  std::vector<std::string> only_in_first, only_in_second;
  double scale = 1;  ///< first's metres by the second's
};

/// Points for the differences in pixels: a grid of 9x9 pixels of the first rig's camera, each at
/// `nearest`, twice and four times as far and at infinity; metres; 0: ten times the median distance
/// between neighbours. Throws Error (bad input) where fewer than two cameras are common.
RigComparison compare_rigs(const RigDocument& first, const RigDocument& second, double nearest_m);

std::string format_rig_comparison(const RigComparison& comparison);
std::string rig_comparison_json(const RigComparison& comparison);

}  // namespace raystage
