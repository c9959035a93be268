// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "calibrate/geometry/solve.h"
#include "calibrate/geometry/uncertainty.h"

namespace raystage {

/// What one camera contributed, and how well it fits.
struct CameraFit {
  int observations = 0, inliers = 0;  ///< points: that it saw; that count
  double rms_px = 0;                  ///< of those that count; NaN where none does
  double image_coverage = 0;  ///< share of the picture's sixteenths with a point that counts
};

std::vector<CameraFit> camera_fits(const ArrayModel& model);

/// Which cameras saw the same points.
struct Overlap {
  std::vector<std::vector<int>> shared;  ///< points that two cameras both saw; square, symmetric
  /// Cameras joined by pairs that share enough points to place one by the other, largest group
  /// first; one group where all hang together.
  std::vector<std::vector<int>> groups;

  /// Pairs without a common point, lower index first.
  std::vector<std::pair<int, int>> pairs_without_points() const;
};

Overlap compute_overlap(const ArrayModel& model);

struct AcceptanceLimits {
  double max_rms_px = 1;            ///< thesis 4.3: below one pixel
  double max_outlier_ratio = 0.35;  ///< share of the detections
  int min_points = 12;              ///< that count in a camera
  Tolerances tolerances = {};
};

/// Whether a calibration is accepted, why not, and what to record next. Texts are sentences for
/// reports.
struct CalibrationVerdict {
  bool is_accepted() const { return reasons.empty(); }
  std::vector<std::string> reasons;     ///< why not
  std::vector<std::string> warnings;    ///< what is weak, though within limits
  std::vector<std::string> next_steps;  ///< what to record or to give
};

CalibrationVerdict judge_calibration(const ArrayModel& model,
                                     const std::optional<Uncertainty>& uncertainty,
                                     bool scale_is_known, const AcceptanceLimits& limits);

/// "the focal length (and with it the depth of everything)": what changes together in a direction.
std::string describe_direction(const Uncertainty::Direction& direction, const ArrayModel& model);

/// The first few of many names: "a, b, c and 4 more".
std::string abbreviate_list(const std::vector<std::string>& names, std::size_t most = 6);

}  // namespace raystage
