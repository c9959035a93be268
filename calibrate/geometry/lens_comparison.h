// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "calibrate/geometry/lens_calibration.h"

namespace raystage::calibrate {

/// How well one lens model explains the boards of a camera. Errors are those of all corners, so
/// that they compare between models: corners that a model places farther off than
/// LensCalibrationOptions::max_error_px, or not at all, count as that far off.
struct LensModelFit {
  schemas::Projection projection = schemas::Projection::kPinhole;
  LensCalibration calibration;  ///< from all boards
  double rms_px = 0;            ///< of all boards
  /// Of boards that were held out: each half of the boards is tested with the lens from the other
  /// half; only the poses of its boards are fitted.
  double held_out_rms_px = 0;
  /// Bayesian information criterion, n log(squared error / n) + p log n, of n coordinates and p
  /// lens and board parameters (Schwarz 1978); differences above 10 are strong.
  double bic = 0;
  /// Whether the held-out boards fit it worse than the model with the least error: see fit_worse().
  bool is_worse = false;
  double distortion_px = 0;  ///< RMS displacement of the corners by the distortion terms
  std::string failure;       ///< why the model cannot be fitted; empty: it is
};

/// Lens models of a camera, in the order of the projections.
struct LensModelComparison {
  std::vector<LensModelFit> fits;
  /// Of the models that held-out boards do not fit worse than that with the least error: the
  /// pinhole, which all methods render; otherwise the one with the least distortion, which depends
  /// least on terms that hold only where corners were seen.
  std::size_t best = 0;

  const LensModelFit& best_fit() const { return fits[best]; }
};

/// The models that are compared. An f-theta lens is not among them: it equals the fisheye.
std::span<const schemas::Projection> compared_projections();

/// Calibrates the lens with each model and compares them. Half angle and other settings are those
/// of `options`. Throws Error (bad input) as calibrate_lens(), with fewer than eight usable views,
/// and if no model fits; (failed) if a stop is requested.
LensModelComparison compare_lens_models(const CameraBoardViews& camera,
                                        const LensCalibrationOptions& options);

/// Returns the best model for cameras of one type: as LensModelComparison::best among the models
/// that fit no camera worse than its best one; without any, that with the least error over all
/// cameras.
schemas::Projection best_common_projection(std::span<const LensModelComparison> cameras);

}  // namespace raystage::calibrate
