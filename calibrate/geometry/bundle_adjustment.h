// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <stop_token>
#include <string>
#include <vector>

#include "base/run_status.h"
#include "calibrate/geometry/array_model.h"
#include "calibrate/geometry/lens_parameters.h"

namespace raystage::calibrate {

struct BundleAdjustmentOptions {
  LensRefinement lens = LensRefinement::kNone;
  bool shared_lens = true;  ///< one lens for all cameras, if they have one projection
  /// Above 0: noise of the detections, pixels, at which a shared lens prior applies to a lens per
  /// camera: they differ by LensParameter::deviation_in_type. Needs one projection.
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
/// Undetermined cameras and points stay so; observations of points that their lenses do not see
/// become outliers. If fewer than two cameras are held, the world may drift, rotate and change its
/// scale. Weak priors constrain what the observations do not determine of a lens: the principal
/// point at the image centre (deviation: a tenth of the width), small distortion. Throws Error
/// (failed) if a stop is requested.
BundleAdjustmentReport run_bundle_adjustment(ArrayModel& model,
                                             const BundleAdjustmentOptions& options);

/// Marks observations with a reprojection error above `max_error_px` as outliers, and the others as
/// inliers. Independent points with fewer than two inliers become undetermined. Returns the number
/// of changed observations.
int classify_outliers(ArrayModel& model, double max_error_px);

/// Returns whether a bundle adjustment refines one lens for all cameras.
bool shares_one_lens(const ArrayModel& model, const BundleAdjustmentOptions& options);

}  // namespace raystage::calibrate
