// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <stop_token>
#include <string>
#include <vector>

#include "rig/rig.h"
#include "store/take.h"

namespace raystage::calibrate {

struct PatchSearchOptions {
  schemas::DepthRange depths;    ///< of the scene, in front of the array
  int instants = 5;              ///< spread over the take
  int columns = 40, rows = 30;   ///< grid of patches of a picture that are searched in others
  int neighbours = 6;            ///< number of nearest cameras that are searched
  int max_points = 12000;        ///< largest number; a larger one is thinned evenly
  double min_ncc = 0.92;         ///< normalised cross-correlation between two cameras, up to 1
  double min_contrast = 0.02;    ///< standard deviation of the square root of a patch's light
  double min_ncc_margin = 0.05;  ///< margin of the score over any other depth
  bool is_valid(std::string* reason) const;
};

/// A small patch of a surface with its observations.
struct ScenePatch {
  struct Observation {
    int camera = 0;
    double x = 0, y = 0;  ///< its centre, pixels from the picture's top-left corner
    /// mean linear light, full scale 1, after correction of response curve and hot pixels
    schemas::Rgb measured{};
  };
  std::vector<Observation> observations;  ///< at least two
};

/// Returns patches that several cameras observe. The depth of a patch is the one at which most
/// neighbouring cameras show the same pattern by normalised cross-correlation. Left out are patches
/// without contrast, with ambiguous depth, hidden from most cameras, outside `depths`, black or at
/// full scale. Cameras are in the order of rig and take. Progress and errors as track_light().
std::vector<ScenePatch> find_scene_patches(const store::Take& take, const rig::Rig& rig,
                                           const PatchSearchOptions& options,
                                           const std::function<void(double)>& progress,
                                           const std::stop_token& stop);

}  // namespace raystage::calibrate
