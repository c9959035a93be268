// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "calibrate/geometry/bundle_adjustment.h"
#include "calibrate/geometry/lens_parameters.h"

namespace raystage::calibrate {

/// Accuracy at which errors of a calibration stay invisible in renderings, as limits of two
/// standard deviations (95 %).
struct Tolerances {
  double position = 0.05;         ///< relative to the distance between neighbours
  double rotation_deg = 0.2;      ///< of a camera's rotation
  double focal_length = 0.01;     ///< relative
  double principal_point = 0.02;  ///< relative to the picture's width
  double corner_px = 1;           ///< effect of the distortion in the picture's corner
};

/// Uncertainty of a calibrated array, from the covariance of its bundle adjustment.
struct Uncertainty {
  /// One standard deviation each.
  struct Camera {
    Eigen::Vector3d position = Eigen::Vector3d::Zero();      ///< along the world's axes, its units
    Eigen::Vector3d rotation_deg = Eigen::Vector3d::Zero();  ///< about the camera's x, y and z
    LensParameters lens{};                                   ///< 0: held
  };
  /// none: no pose, or without observations that are used
  std::vector<std::optional<Camera>> cameras;
  double noise_px = 0;  ///< of one coordinate of a detection, estimated from the residuals
  /// Correlation of a camera's successive residuals, 0 to 1. Errors that persist (a clock, a lens)
  /// do not average out over many points, so deviations are enlarged by it.
  double correlation = 0;

  /// A linear combination of parameters that is poorly determined.
  struct Direction {
    double deviation = 0;  ///< two standard deviations, in tolerances; above 1: too uncertain
    /// shares, sum 1
    double focal_length = 0, principal_point = 0, distortion = 0, positions = 0, rotations = 0;
    std::vector<int> cameras;  ///< whose positions and rotations change, if they are few
  };
  std::vector<Direction> weakest;  ///< the worst first: all above 1, and at least one
};

/// Estimates the uncertainty of the parameters that the last bundle adjustment (`free`) refined.
/// The covariance is that of a free network: translation, rotation and scale of the whole world are
/// removed (Triggs et al. 2000, section 9). What no observation determines is infinitely uncertain;
/// the solver's weak lens priors are ignored. Points are free parameters. `noise_px` is at least
/// `min_noise_px`, because residuals of few observations are too small. None without observations
/// that are used.
std::optional<Uncertainty> estimate_uncertainty(const ArrayModel& model,
                                                const BundleAdjustmentOptions& free,
                                                const Tolerances& tolerances,
                                                double min_noise_px = 0.02);

/// Returns the median distance from a camera to the nearest other, world units; 0 with fewer than
/// two cameras.
double median_neighbour_distance(const ArrayModel& model);

}  // namespace raystage::calibrate
