// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "compose/layers/merge.h"

namespace raystage {

/// What a picture is made of, pixel by pixel: samples from front to back, one of each layer at
/// most.
struct DeepImage {
  struct Sample {
    float rgba[4];  ///< premultiplied
    float z;        ///< planar depth, metres; kBackgroundDepth where there is none
  };
  int width = 0, height = 0;
  std::vector<std::uint32_t> begin;  ///< of each pixel's samples, and their end: pixels + 1
  std::vector<Sample> samples;
};

/// Where deep pictures put what lies behind everything: files must not say infinity.
inline constexpr float kBackgroundDepth = 1e9F;

/// Samples which put together from front to back, each over those behind it, are what merge() makes
/// of the layers in the order of their depth. What a holdout cuts is cut from the samples behind
/// it.
DeepImage deep_samples(std::span<const MergedLayer> layers);

/// "Over" of all samples, R, G, B, A a pixel.
std::vector<float> flattened(const DeepImage& image);

}  // namespace raystage
