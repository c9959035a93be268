// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <stop_token>
#include <string>
#include <vector>

#include "calibrate/detect/board.h"
#include "calibrate/geometry/lens_calibration.h"
#include "schemas/rig_document.h"
#include "store/take.h"

namespace raystage::calibrate {

struct LensesFromTakeOptions {
  std::vector<std::string> cameras;       ///< ids; empty: all of the take
  std::vector<std::string> shared_prior;  ///< ids of cameras of one model, or "all"
  int max_views = 60;                     ///< of each camera, spread over the take
  LensCalibrationOptions lens;
  bool is_valid(std::string* reason) const;
};

/// A camera of the take and its lens.
struct CameraLens {
  std::string id;
  int width = 0, height = 0;  ///< pixels
  LensCalibration calibration;
};

/// Calibrates the lenses of a take's cameras from the board that they show (Zhang 2000); cameras of
/// `shared_prior` share a prior (calibrate_lenses_with_shared_prior()). Returns one lens for each
/// camera of `options`. Calls `progress` with the share that is done, in [0, 1]. Throws Error
/// (bad input) for unknown cameras, (failed) if a stop is requested.
std::vector<CameraLens> calibrate_lenses(const store::Take& take, const BoardDetector& detector,
                                         const LensesFromTakeOptions& options,
                                         const std::function<void(double)>& progress,
                                         const std::stop_token& stop);

/// Returns whether no lens has a reason for rejection.
bool are_accepted(const std::vector<CameraLens>& lenses);

/// Returns the lenses as a rig without poses, for initial_lenses().
schemas::RigDocument make_lens_document(const std::vector<CameraLens>& lenses);

/// Returns residuals, parameters, coverage, reasons and advice as lines of text.
std::string format_lens(const CameraLens& lens);

}  // namespace raystage::calibrate
