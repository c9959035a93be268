// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "schemas/photometric.h"

namespace raystage {

/// How well cameras agree about what they all show, before and after.
struct ColorSpread {
  Rgb deviation{};  ///< of the cameras' means about their mean, by it: the worst target's
  double mean_difference = 0;  ///< CIEDE2000 from what it should be, over cameras and targets
  double most_difference = 0;
};

/// What makes an array's cameras alike, and whether it can be vouched for. Sentences for people.
struct ColorMatch {
  std::vector<PhotometricResponse> responses;  ///< of each camera
  ColorSpread before, after;
  std::vector<std::string> findings;  ///< what else was found, a line each: a word, then what
  std::vector<std::string> reasons, warnings;  ///< why it cannot be vouched for; what is weak
};

/// For people at a terminal. `reference`: the camera that the others are made alike to.
std::string color_text(const ColorMatch& match, const std::string& reference);

/// The same for programs, with each camera's response as rig.json has it, in the order of
/// `cameras`.
std::string color_json(const ColorMatch& match, const std::string& reference,
                       const std::vector<std::string>& cameras);

}  // namespace raystage
