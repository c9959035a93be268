// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "calibrate/geometry/array_model.h"
#include "calibrate/geometry/bundle_adjustment.h"

namespace raystage::calibrate {

/// What the observations of a moving point show about the times of their cameras.
struct TimeCorrection {
  /// Seconds by which each camera's times are ahead; mean 0; 0 where it is not estimated.
  std::vector<double> clock_s;
  /// Line time of each camera in addition to the one that the times have already, microseconds; 0
  /// where it is not estimated.
  std::vector<double> line_time_us;
  std::vector<int> line_cameras;  ///< whose line time is estimated
  /// Covariance of the line times of `line_cameras`, microseconds squared.
  Eigen::MatrixXd line_covariance;
  double noise_px = 0;  ///< of one coordinate of an observation
};

struct TimeCorrectionOptions {
  bool estimates_clocks = true;
  /// Per camera: whether its line time is estimated.
  std::vector<bool> estimates_line_time;
};

/// Estimates clock offsets and line times from the residuals of a converged calibration, jointly
/// with small changes of all parameters that its last bundle adjustment (`free`) refined, and of
/// all points. `velocities`: of the point in the picture at each observation of the model, pixels
/// per second; none: the observation is not used. Points without a body only. nullopt if fewer than
/// two cameras have enough observations.
std::optional<TimeCorrection> estimate_time_correction(
    const ArrayModel& model, const BundleAdjustmentOptions& free,
    const std::vector<std::optional<Eigen::Vector2d>>& velocities,
    const TimeCorrectionOptions& options);

}  // namespace raystage::calibrate
