// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <stop_token>
#include <vector>

#include "rig/rig.h"
#include "store/take.h"

namespace raystage {

struct PatchSearchSettings {
  DepthRange depths;             ///< of the scene, in front of the array
  int instants = 5;              ///< spread over the take
  int columns = 40, rows = 30;   ///< patches in a camera's picture that are looked for in others
  int neighbours = 6;            ///< cameras in which they are: the nearest
  int max_points = 12000;        ///< as many are taken evenly of what is found
  double min_ncc = 0.92;         ///< normalised cross-correlation of what two cameras show, up to 1
  double min_contrast = 0.02;    ///< of a patch: standard deviation of the root of its light
  double min_ncc_margin = 0.05;  ///< in likeness, on any other depth
};

/// A small patch of a surface and what several cameras show of it.
struct ScenePatch {
  struct Observation {
    int camera = 0;
    double x = 0, y = 0;  ///< its middle, pixels from the picture's top-left corner
    Rgb measured{};       ///< its mean: linear light, full scale 1, by curve and dark pixels of the
                          ///< camera
  };
  std::vector<Observation> observations;  ///< at least two
};

/// Patches that several cameras show: for each camera and patch of its picture the depth at which
/// most of the cameras next to it show the same pattern, whatever their contrast.
/// Left out is what has no pattern, looks alike at several depths, is hidden from most cameras,
/// lies nearer or farther than `depths`, or is black or at full scale. Cameras in the order of the
/// rig, which is the take's. Progress and errors as track_light().
std::vector<ScenePatch> find_scene_patches(const Take& take, const Rig& rig,
                                           const PatchSearchSettings& settings,
                                           const std::function<void(double)>& progress,
                                           const std::stop_token& stop);

}  // namespace raystage
