// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <stop_token>

#include "calibrate/color/color_match.h"
#include "calibrate/color/scene_patches.h"

namespace raystage::calibrate {

struct SceneColorMatch : ColorMatch {
  static constexpr double kMaxUncertainty = 0.03;  ///< largest accepted uncertainty; see ColorFit
};

/// Returns contrast and brightness of each camera and channel relative to a reference camera
/// (thesis 4.3, eq. 4.1) without a target. Method: robust least squares over cameras and the light
/// of common points. Other fields, and the reference camera's response, stay as in `rig`. Outliers
/// (ghosts, reflections, motion) are removed and counted. Throws Error (failed) if a stop is
/// requested.
SceneColorMatch match_scene_colors(std::span<const ScenePatch> points, const rig::Rig& rig,
                                   int reference, const std::stop_token& stop);

}  // namespace raystage::calibrate
