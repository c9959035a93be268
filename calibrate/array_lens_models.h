// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "calibrate/geometry/calibration.h"
#include "calibrate/track_calibration.h"

namespace raystage::calibrate {

/// How well one lens model explains what the cameras of an array saw.
struct ArrayLensModelFit {
  schemas::Projection projection = schemas::Projection::kPinhole;
  /// Reprojection error of points that were held out, pixels: each half of the points (or boards)
  /// is tested with the cameras that the other half determines; only the positions of its points
  /// are fitted. Errors above 3 px count as 3 px, points that cannot be placed too.
  double held_out_rms_px = 0;
  /// Whether the held-out points, or boards, fit it worse than the model with the least error: see
  /// fit_worse().
  bool is_worse = false;
  double distortion_px = 0;  ///< RMS displacement of the held-out points by the distortion terms
  std::string failure;       ///< why the model cannot be fitted; empty: it is
};

/// Lens models of an array, which all of its cameras share, in the order of compared_projections().
struct ArrayLensModelComparison {
  std::vector<ArrayLensModelFit> fits;
  std::size_t best = 0;  ///< as LensModelComparison::best
  int held_out = 0;      ///< points or boards, each once
  bool are_boards = false;
};

/// Returns the settings for cameras that all have one lens model. Half angles remain.
CalibrationOptions with_lens_model(CalibrationOptions options, std::size_t cameras,
                                   schemas::Projection projection);

/// Calibrates the array twice with each lens model and compares them. The models of `options` do
/// not matter, except for their half angles. Throws Error (bad input) if no model fits; (failed) if
/// a stop is requested.
ArrayLensModelComparison compare_array_lens_models(const Detections& detections,
                                                   const CalibrationOptions& options);

/// Compares them for tracks of a light or a board, with the clocks and line times that the first
/// model finds which fits: those of OpenCV's fisheye, usually.
ArrayLensModelComparison compare_track_lens_models(const RecordedTracks& tracks,
                                                   const TrackCalibrationOptions& options);

/// Returns a line of text for each model.
std::string format_array_lens_models(const ArrayLensModelComparison& comparison);

/// Returns a section of a page (calibration_report_html()) with a table of the models.
std::string lens_models_html(const ArrayLensModelComparison& comparison);

/// Returns a report (calibration_report_json()) with the models as "models".
std::string with_lens_models_json(const std::string& report,
                                  const ArrayLensModelComparison& comparison);

}  // namespace raystage::calibrate
