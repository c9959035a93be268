// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <stop_token>
#include <string>
#include <vector>

#include "base/run_status.h"
#include "calibrate/geometry/array_model.h"
#include "calibrate/geometry/lens_projection.h"

namespace raystage::calibrate {

/// Lens parameters that a bundle adjustment refines; each step includes those of the one before.
enum class LensRefinement {
  kNone,
  kFocalLength,  ///< one for x and y (square pixels)
  kPinhole,      ///< and the principal point
  kRadial,       ///< and k1, k2
  kFullModel     ///< and k3, tangential distortion, separate focal lengths for x and y
};

/// Standard deviations of the lenses of one model: fx and fy relative, cx and cy (unused), k1, k2,
/// p1, p2, k3 absolute.
inline constexpr LensParameters kLensPriorDeviations{0.004, 0.004, 0,     0,   0.01,
                                                     0.02,  0.001, 0.001, 0.04};

struct BundleAdjustmentOptions {
  LensRefinement lens = LensRefinement::kNone;
  bool shared_lens = true;  ///< one lens for all cameras
  /// Above 0: noise of the detections, pixels, at which a shared lens prior applies to a lens per
  /// camera: they differ by kLensPriorDeviations except for their principal points.
  double lens_prior_noise_px = 0;
  std::vector<bool> fixed_cameras = {};  ///< whose poses are held; empty: none
  /// Scale of Cauchy's loss, pixels: residuals beyond it lose weight; 0: least squares.
  double loss_scale_px = 1;
  int max_iterations = 50;
  std::stop_token stop = {};  ///< stops it
  bool is_valid(std::string* reason) const;
};

struct BundleAdjustmentReport {
  RunStatus status = RunStatus::kNotRun;
  int observations = 0;
  double rms_px = 0;  ///< afterwards, over the observations that are used
};

/// Refines points, cameras and lenses to minimise the reprojection error (thesis 4.3: one large
/// least squares over all of them). Uses Ceres: Levenberg-Marquardt with a Schur complement that
/// eliminates the points. Points of a body move with it as a whole and hold the world's scale.
/// Undetermined cameras and points stay so; observations of points behind their cameras become
/// outliers. If fewer than two cameras are held, the world may drift, rotate and change its scale.
/// Weak priors constrain what the observations do not determine of a lens: the principal point at
/// the image centre (deviation: a tenth of the width), small distortion. Throws Error (failed) if a
/// stop is requested.
BundleAdjustmentReport run_bundle_adjustment(ArrayModel& model,
                                             const BundleAdjustmentOptions& options);

/// Marks observations with a reprojection error above `max_error_px` as outliers, and the others as
/// inliers. Independent points with fewer than two inliers become undetermined. Returns the number
/// of changed observations.
int classify_outliers(ArrayModel& model, double max_error_px);

/// Returns the indices of the lens parameters (lens_projection.h) that a bundle adjustment holds.
/// Except for the full model fy follows fx.
std::vector<int> fixed_lens_parameters(LensRefinement freedom);

}  // namespace raystage::calibrate
