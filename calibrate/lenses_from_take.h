// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "calibrate/detect/board.h"
#include "calibrate/geometry/lens_calibration.h"
#include "calibrate/geometry/lens_comparison.h"
#include "schemas/rig_document.h"
#include "store/take.h"

namespace raystage::calibrate {

struct LensesFromTakeOptions {
  std::vector<std::string> cameras;       ///< ids; empty: all of the take
  std::vector<std::string> shared_prior;  ///< ids of cameras of one model, or "all"
  int max_views = 60;                     ///< of each camera, spread over the take
  /// Projection of all lenses; none: of each camera that of the take's rig.
  std::optional<schemas::Projection> projection = std::nullopt;
  /// Half angle of fisheyes, radians; none: that of the take's rig.
  std::optional<double> half_angle = std::nullopt;
  /// Fits each lens model and uses the best, instead of `projection`.
  bool compares_models = false;
  LensCalibrationOptions lens;  ///< its model is not used
  bool is_valid(std::string* reason) const;
};

/// A camera of the take and its lens.
struct CameraLens {
  std::string id;
  int width = 0, height = 0;  ///< pixels
  LensCalibration calibration;
  std::optional<LensModelComparison> comparison = std::nullopt;  ///< if models were compared
};

/// Calibrates the lenses of a take's cameras from the board that they show (Zhang 2000); cameras of
/// `shared_prior` share a prior (calibrate_lenses_with_shared_prior()). Returns one lens for each
/// camera of `options`. If models are compared, cameras with a shared prior have one in common, the
/// best for all of them. Calls `progress` with the share that is done, in [0, 1]. Throws Error (bad
/// input) for unknown cameras, (failed) if a stop is requested.
std::vector<CameraLens> calibrate_lenses(const store::Take& take, const BoardDetector& detector,
                                         const LensesFromTakeOptions& options,
                                         const std::function<void(double)>& progress,
                                         const std::stop_token& stop);

/// Returns whether no lens has a reason for rejection.
bool are_accepted(const std::vector<CameraLens>& lenses);

/// Returns the lenses as a rig without poses, for initial_lenses().
schemas::RigDocument make_lens_document(const std::vector<CameraLens>& lenses);

}  // namespace raystage::calibrate
