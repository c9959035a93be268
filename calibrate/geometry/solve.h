// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "base/run_status.h"
#include "calibrate/geometry/array_model.h"
#include "calibrate/geometry/bundle_adjustment.h"

namespace raystage::calibrate {

/// State after one step of a solve.
struct SolveStep {
  std::string what;  ///< "poses", "shared focal length" ...
  double rms_px = 0;
  int observations = 0, outliers = 0;
};

struct SolveOptions {
  /// Horizontal field of view of all cameras, radians; none: several are tried.
  std::optional<double> horizontal_fov = {};
  /// Kind of each camera's lens; empty: those of `lenses`, or pinholes.
  std::vector<LensModel> lens_models = {};
  /// Initial lens of each camera, in place of the field of view.
  std::vector<schemas::Intrinsics> lenses = {};
  /// Initial pose of each camera, or none. With two or more, the world frame is theirs.
  std::vector<std::optional<rig::Pose>> poses = {};
  std::vector<bool> fixed_cameras = {};                ///< whose poses are held; empty: none
  bool lens_is_known = false;                          ///< lenses are held
  bool lens_per_camera = false;                        ///< the last steps refine a lens per camera
  bool full_lens_model = false;                        ///< also k3 and tangential distortion
  std::stop_token stop = {};                           ///< stops it
  std::function<void(const SolveStep&)> on_step = {};  ///< called after each step, if set
};

/// Record of a solve.
struct SolveReport {
  RunStatus status = RunStatus::kNotRun;
  using Step = SolveStep;
  std::vector<Step> steps;
  BundleAdjustmentOptions last;  ///< settings of the last bundle adjustment
  double seconds = 0;
};

/// Calibrates an array from detections: initial poses (or those given), then bundle adjustments
/// that refine more and more lens parameters, with outliers classified after each. Throws Error
/// (bad input) if no two cameras share enough points, (failed) if a stop is requested. Cameras with
/// too few points have no pose.
ArrayModel solve_array(const Detections& detections, const SolveOptions& options,
                       SolveReport& report);

}  // namespace raystage::calibrate
