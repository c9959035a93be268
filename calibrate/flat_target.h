// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <stop_token>
#include <string>
#include <vector>

#include "schemas/rig_document.h"
#include "store/take.h"

namespace raystage {

using Rgb = std::array<double, 3>;  ///< linear light, full scale 1, as the camera shows it

/// What one camera shows of a target that is everywhere as bright.
struct FlatSight {
  Rgb mean{};
  Rgb deviation{};     ///< from pixel to pixel
  Rgb black{};         ///< share of pixels at code 0: they may be darker than they can say
  double clipped = 0;  ///< share of pixels with a channel at full scale
};

/// The mean over the middle of the picture (`share` of its width and height) and over frames, at
/// most `most_frames` of them, spread over the take. Throws Error (bad input) for a camera without
/// frames.
FlatSight flat_sight(const Take& take, int camera, double share = 0.5, int most_frames = 12);

/// Sights of all cameras in one take of a target.
using FlatSights = std::vector<FlatSight>;
FlatSights flat_sights(const Take& take, const std::stop_token& stop);

struct FlatColorSettings {
  int reference = 0;     ///< camera that the others are made alike to
  bool neutral = false;  ///< and makes the brightest target grey
};

/// How well cameras agree about targets, before and after.
struct ColorSpread {
  Rgb deviation{};  ///< of the cameras' means about their mean, by it: the worst target's
  double mean_difference = 0;  ///< CIEDE2000 from the reference camera, over cameras and targets
  double most_difference = 0;
};

struct FlatColors {
  std::vector<PhotometricResponse> responses;  ///< of each camera
  ColorSpread before, after;
  std::vector<std::string> reasons, warnings;  ///< why it cannot be vouched for; what is weak
};

/// Contrast and brightness of each camera and channel against a reference camera (thesis 4.3, eq.
/// 4.1), by least squares over targets of different brightness (lens caps, grey, white): `targets`
/// by take. Blacks that are cut off at code 0 tell nothing. One target tells the contrast alone.
/// Throws Error (bad input) where a camera sees no light.
FlatColors match_flat_targets(const std::vector<FlatSights>& targets,
                              const std::vector<std::string>& cameras,
                              const FlatColorSettings& settings);

/// What a camera shows, as it is corrected.
Rgb corrected(const PhotometricResponse& response, const Rgb& shown);

std::string color_text(const FlatColors& colors, const std::string& reference);

}  // namespace raystage
