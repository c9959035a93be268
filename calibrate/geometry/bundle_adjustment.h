// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <stop_token>
#include <vector>

#include "calibrate/geometry/array_model.h"
#include "calibrate/geometry/lens_projection.h"

namespace raystage {

/// What a bundle adjustment may change of lenses; each step releases what the one before did, too.
enum class LensRefinement {
  kNone,
  kFocalLength,  ///< one for x and y: pixels are square
  kPinhole,      ///< and principal point
  kRadial,       ///< k1 and k2
  kFullModel     ///< k3, tangential distortion, a focal length each for x and y
};

/// By what lenses of one make differ, one standard deviation: fx and fy by themselves, cx and cy
/// (not looked at), k1, k2, p1, p2, k3.
inline constexpr LensParameters kLensPriorDeviations{0.004, 0.004, 0,     0,   0.01,
                                                     0.02,  0.001, 0.001, 0.04};

struct BundleAdjustmentSettings {
  LensRefinement lens = LensRefinement::kNone;
  bool shared_lens = true;  ///< one lens for all cameras
  /// Above 0: lenses are of one kind, so that with a lens each they differ by kLensPriorDeviations
  /// but for their principal points, where detections are as noisy as this, pixels.
  double lens_prior_noise_px = 0;
  std::vector<bool> fixed_cameras = {};  ///< whose poses rest; empty: none's
  /// Pixels at which Cauchy's loss begins to believe an observation less; 0: least squares.
  double loss_scale_px = 1;
  int max_iterations = 50;
  std::stop_token stop = {};  ///< asks to end it
};

struct BundleAdjustmentReport {
  bool converged = false;
  int iterations = 0, observations = 0;
  double rms_px = 0;  ///< afterwards, of what counts
};

/// Moves points, cameras and lenses so that points are seen where they were (thesis 4.3: one large
/// least squares over all of them), by Ceres: Levenberg and Marquardt's steps, with points
/// eliminated. Points of bodies move with these as a whole, and hold the world's scale. What is not
/// found stays so; observations of points behind their cameras become
/// outliers. Where fewer than two cameras are held, the world may drift, turn and grow as a whole.
/// What the observations leave open of a lens stays near an ordinary one: its middle in the
/// picture's (deviation a tenth of the width), its distortion small. Throws Error (failed) when a
/// stop is asked for.
BundleAdjustmentReport run_bundle_adjustment(ArrayModel& model,
                                             const BundleAdjustmentSettings& settings);

/// Marks as outliers observations farther from where they should be than `max_error_px`, and lets
/// those count again that are nearer. Points on their own that fewer than two cameras see are then
/// lost. Returns how many changed.
int classify_outliers(ArrayModel& model, double max_error_px);

/// Indices of the lens values (lens_projection.h) that a bundle adjustment may not change; but for
/// the whole model fy follows fx.
std::vector<int> fixed_lens_parameters(LensRefinement freedom);

}  // namespace raystage
