// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "calibrate/geometry/array_model.h"
#include "calibrate/geometry/bundle_adjustment.h"

namespace raystage {

/// What one step of a solve came to.
struct SolveStep {
  std::string what;  ///< "poses", "shared focal length" ...
  double rms_px = 0;
  int observations = 0, outliers = 0;
};

struct SolveSettings {
  /// Of all cameras, radians; none: not known, several are tried.
  std::optional<double> horizontal_fov = {};
  /// Of each camera: taken as a first guess for its lens, in place of the field of view.
  std::vector<Intrinsics> lenses = {};
  /// Of each camera, none where not known: where to begin, instead of from nothing. With two or
  /// more, the world stays over them.
  std::vector<std::optional<Pose>> poses = {};
  std::vector<bool> fixed_cameras = {};  ///< whose poses stay as they are; empty: none's
  bool lens_is_known = false;            ///< lenses stay as they are
  bool lens_per_camera = false;          ///< in the end each camera has a lens of its own
  bool full_lens_model = false;          ///< k3 and tangential distortion, too
  std::stop_token stop = {};             ///< asks to end it
  std::function<void(const SolveStep&)> on_step = {};  ///< told of each, where given
};

/// What became of a solve.
struct SolveReport {
  using Step = SolveStep;
  std::vector<Step> steps;
  BundleAdjustmentSettings last;  ///< what was free in the end
  double seconds = 0;
};

/// Finds an array from what it saw: first poses (or those it is to begin with), then one bundle
/// adjustment after the other, with more and more of the lenses released, outliers sorted out after
/// each. Throws Error (bad input) where no two cameras share enough points. Cameras that see too
/// few have no pose. Throws Error (failed) when a stop is asked for.
ArrayModel solve_array(const Detections& detections, const SolveSettings& settings,
                       SolveReport& report);

}  // namespace raystage
