// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "calibrate/geometry/bundle_adjustment.h"
#include "calibrate/geometry/lens_projection.h"

namespace raystage {

/// How far off a calibration may be before renderings show it: two standard deviations, so that
/// nineteen of twenty are nearer.
struct Tolerances {
  double position = 0.05;         ///< of the distance from one camera to the next
  double rotation_deg = 0.2;      ///< of a camera's direction
  double focal_length = 0.01;     ///< of itself
  double principal_point = 0.02;  ///< principal point, of the width
  double corner_px = 1;           ///< what distortion may be off by in the picture's corner
};

/// How surely an array is known, from the covariance of its bundle adjustment.
struct Uncertainty {
  /// One standard deviation each.
  struct Camera {
    Eigen::Vector3d position = Eigen::Vector3d::Zero();      ///< along the world's axes, its units
    Eigen::Vector3d rotation_deg = Eigen::Vector3d::Zero();  ///< about the camera's x, y and z
    LensParameters lens{};                                   ///< 0: held
  };
  std::vector<std::optional<Camera>> cameras;  ///< none: not found, or nothing of it counts
  double noise_px = 0;  ///< of one coordinate of a detection, as the residuals tell
  /// Of residuals of one camera that follow each other, 0 to 1: what errs alike for long (a clock,
  /// a lens) is no noise, and many points tell no more of it than few. Deviations are larger by it.
  double correlation = 0;

  /// Something that changes together.
  struct Direction {
    double deviation = 0;  ///< two standard deviations, in tolerances; above 1: not known well
    double focal_length = 0, principal_point = 0, distortion = 0, positions = 0,
           rotations = 0;      ///< shares, sum 1
    std::vector<int> cameras;  ///< whose positions and rotations, where these are few
  };
  std::vector<Direction> weakest;  ///< the worst first; those above 1, and one
};

/// What was free in the last bundle adjustment, and who was held, decides what is uncertain. The
/// covariance is that of a free network: of all worlds that explain the observations alike, drift,
/// turn and scale are taken out (Triggs et al. 2000, section 9); what no observation tells is
/// infinitely uncertain, whatever the solver's weak assumptions about lenses made of it. Every
/// point is as uncertain as its observations leave it. `noise_px` is never taken below
/// `min_noise_px`: residuals of few observations say little. None where nothing counts.
std::optional<Uncertainty> estimate_uncertainty(const ArrayModel& model,
                                                const BundleAdjustmentSettings& free,
                                                const Tolerances& tolerances,
                                                double min_noise_px = 0.02);

/// Median distance from a camera to the nearest other, world units; 0 with fewer than two cameras.
double median_neighbour_distance(const ArrayModel& model);

}  // namespace raystage
