// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <stop_token>

#include "calibrate/color/color_match.h"
#include "calibrate/color/scene_patches.h"

namespace raystage {

struct SceneColorMatch : ColorMatch {
  static constexpr double kMaxUncertainty = 0.03;  ///< that is vouched for; see ColorFit
};

/// Contrast and brightness of each camera and channel against a reference camera (thesis 4.3, eq.
/// 4.1) without a target: those by which cameras agree about the light of the same points, by
/// robust least squares over cameras and points together. Everything else stays as `rig` has it,
/// the reference camera's contrast and brightness too. Sights that do not fit (ghosts, reflections,
/// what moved) are left out and counted. Throws Error (failed) when a stop is asked for.
SceneColorMatch match_scene_colors(std::span<const ScenePatch> points, const Rig& rig,
                                   int reference, const std::stop_token& stop);

}  // namespace raystage
