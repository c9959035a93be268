// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "schemas/photometric_response.h"

namespace raystage {

/// How well cameras agree about what they all show, before and after.
struct ColorSpread {
  Rgb deviation{};  ///< of the cameras' means about their mean, by it: the worst target's
  double mean_difference = 0;  ///< CIEDE2000 from what it should be, over cameras and targets
  double max_difference = 0;
};

/// What one camera contributed, and how well it fits in the end.
struct ColorFit {
  int observations = 0, inliers = 0;               ///< targets, patches or places; those that count
  double mean_difference = 0, max_difference = 0;  ///< CIEDE2000, afterwards
  /// Two standard deviations of the light that the camera is said to see, by it, at a tenth of full
  /// scale or at half, whichever is worse; 0: not told.
  double uncertainty = 0;
};

/// Colour responses of an array's cameras, and whether they are accepted. Texts are sentences for
/// reports.
struct ColorMatch {
  std::string what;                            ///< they all showed: "targets", "chart" or "scene"
  std::vector<PhotometricResponse> responses;  ///< of each camera
  ColorSpread before, after;
  std::vector<ColorFit> fits;         ///< of each camera
  std::vector<std::string> findings;  ///< what else was found, a line each: a word, then what
  std::vector<std::string> reasons, warnings;  ///< why it is rejected; what is uncertain
};

/// Standard deviation of one channel over cameras, by the mean; 0 where there are none.
double relative_deviation(const std::vector<Rgb>& of_cameras, std::size_t channel);

/// For people at a terminal: what was found step by step, each on top of the one before.
/// `reference`: the camera that the others are made alike to.
std::string format_color_match(const std::vector<ColorMatch>& steps, const std::string& reference);

/// The same for programs, with each camera's response in the end as rig.json has it, in the order
/// of `cameras`.
std::string color_match_json(const std::vector<ColorMatch>& steps, const std::string& reference,
                             const std::vector<std::string>& cameras);

}  // namespace raystage
