// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "compose/layers/merge.h"

namespace raystage::compose {

/// Samples of each pixel from front to back, at most one per image; a layer has two images where it
/// shows two surfaces (LayerSurfaces).
struct DeepImage {
  struct Sample {
    float rgba[4];  ///< premultiplied
    float z;        ///< planar depth, metres; kBackgroundDepth for none
  };
  int width = 0, height = 0;
  /// Index of each pixel's first sample, then the end: pixels + 1.
  std::vector<std::uint32_t> begin;
  std::vector<Sample> samples;
};

/// Depth of samples without depth, metres: deep files must not contain infinity.
inline constexpr float kBackgroundDepth = 1e9F;

/// Returns samples whose composite from front to back equals merge() of the layers by depth. A
/// holdout attenuates the samples behind it.
DeepImage make_deep_image(std::span<const MergedLayer> layers);

}  // namespace raystage::compose
