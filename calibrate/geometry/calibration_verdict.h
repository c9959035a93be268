// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "calibrate/geometry/uncertainty.h"

namespace raystage::calibrate {

/// Observations of one camera and their reprojection error.
struct CameraFit {
  int observations = 0, inliers = 0;  ///< points: observed by it; used
  double rms_px = 0;                  ///< over the inliers; NaN without any
  /// share of the cells of a 4x4 grid over the picture that have an inlier
  double image_coverage = 0;
};

std::vector<CameraFit> camera_fits(const ArrayModel& model);

/// Common points of cameras.
struct Overlap {
  /// numbers of common points of two cameras; square, symmetric
  std::vector<std::vector<int>> shared;
  /// Groups of cameras that are connected by pairs with enough common points for a relative pose,
  /// the largest first; one group if all are connected.
  std::vector<std::vector<int>> groups;

  /// Returns the pairs without a common point, lower index first.
  std::vector<std::pair<int, int>> pairs_without_points() const;
};

Overlap compute_overlap(const ArrayModel& model);

struct AcceptanceLimits {
  double max_rms_px = 1;            ///< thesis 4.3: below one pixel
  double max_outlier_ratio = 0.35;  ///< share of the observations
  int min_points = 12;              ///< smallest number that is used per camera
  Tolerances tolerances = {};
};

/// Whether a calibration is accepted, and what to record next. Texts are sentences for reports.
struct CalibrationVerdict {
  bool is_accepted() const { return reasons.empty(); }
  std::vector<std::string> reasons;     ///< why it is rejected
  std::vector<std::string> warnings;    ///< weak points within the limits
  std::vector<std::string> next_steps;  ///< what to record or to specify
};

CalibrationVerdict judge_calibration(const ArrayModel& model,
                                     const std::optional<Uncertainty>& uncertainty,
                                     bool scale_is_known, const AcceptanceLimits& limits);

/// Returns what changes together in a direction: "the focal length (and with it the depth of
/// everything)".
std::string describe_direction(const Uncertainty::Direction& direction, const ArrayModel& model);

/// Returns a list of names, shortened after `most`: "a, b, c and 4 more".
std::string abbreviate_list(const std::vector<std::string>& names, std::size_t most = 6);

/// Adds the sentence `before`, the abbreviated list of names, `after`, unless there are no names.
/// Returns whether there are any.
bool add_sentence(std::vector<std::string>& sentences, std::string_view before,
                  const std::vector<std::string>& names, std::string_view after);

}  // namespace raystage::calibrate
