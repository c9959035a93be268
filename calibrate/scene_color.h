// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <span>
#include <stop_token>
#include <string>
#include <vector>

#include "calibrate/color_match.h"
#include "calibrate/surface_points.h"

namespace raystage {

/// What one camera contributed.
struct SceneColorFit {
  int seen = 0, kept = 0;  ///< sights of points; those that count
};

struct SceneColors : ColorMatch {
  int points = 0;
  std::vector<SceneColorFit> fits;  ///< of each camera
  double uncertainty = 0;           ///< see kMostUncertain: the worst camera's
  /// A tenth of full scale and a half, as either half of the points alone would show them: by how
  /// much they may differ from what all points say, by their light.
  static constexpr double kMostUncertain = 0.03;
};

/// Contrast and brightness of each camera and channel against a reference camera (thesis 4.3, eq.
/// 4.1) without a target: those by which cameras agree about the light of the same points, by
/// robust least squares over cameras and points together. Everything else stays as `rig` has it,
/// the reference camera's contrast and brightness too. Sights that do not fit (ghosts, reflections,
/// what moved) are left out and counted. Throws Error (failed) when a stop is asked for.
SceneColors match_scene_colors(std::span<const SurfacePoint> points, const Rig& rig, int reference,
                               const std::stop_token& stop);

}  // namespace raystage
