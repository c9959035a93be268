// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "schemas/photometric_response.h"

namespace raystage::calibrate {

/// Differences between the cameras in what all of them observe.
struct ColorSpread {
  /// standard deviation over cameras relative to their mean, of the worst target
  schemas::Rgb deviation{};
  double mean_difference = 0;  ///< CIEDE2000 from the expected colour, over cameras and targets
  double max_difference = 0;
};

/// Observations of one camera and their residuals after the match.
struct ColorFit {
  /// targets, patches or points; those that are used
  int observations = 0, inliers = 0;
  double mean_difference = 0, max_difference = 0;  ///< CIEDE2000, afterwards
  /// Two standard deviations of the light that the camera measures, relative, at a tenth or at half
  /// of full scale, whichever is worse; 0: not estimated.
  double uncertainty = 0;
};

/// Photometric responses of an array's cameras, and whether they are accepted. Texts are sentences
/// for reports.
struct ColorMatch {
  /// what all cameras observed: "targets", "chart" or "scene"
  std::string what;
  std::vector<schemas::PhotometricResponse> responses;  ///< of each camera
  ColorSpread before, after;
  std::vector<ColorFit> fits;         ///< of each camera
  std::vector<std::string> findings;  ///< further results, a line each: a word, then a text
  std::vector<std::string> reasons, warnings;  ///< why it is rejected; what is uncertain
};

/// Returns the standard deviation of one channel over cameras relative to the mean; 0 without
/// cameras.
double relative_deviation(const std::vector<schemas::Rgb>& of_cameras, std::size_t channel);

/// Returns a text report of all steps, each of which starts from the result of the previous one.
/// `reference`: the camera that the others are matched to.
std::string format_color_match(const std::vector<ColorMatch>& steps, const std::string& reference);

/// Returns the report as JSON, with the final response of each camera as in rig.json, in the order
/// of `cameras`.
std::string color_match_json(const std::vector<ColorMatch>& steps, const std::string& reference,
                             const std::vector<std::string>& cameras);

}  // namespace raystage::calibrate
