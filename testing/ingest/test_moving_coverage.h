// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstddef>
#include <limits>
#include <vector>

#include "simulate/camera_renderer.h"
#include "simulate/world.h"

namespace raystage::testing {

/// For tests: how much of each pixel shows what moves, by 10 x 10 rays. Nothing still may stand
/// before it.
inline std::vector<double> moving_part_coverage(const World& world, const PixelRays& rays) {
  constexpr int kSteps = 10;
  std::vector<double> coverage;
  std::vector<Ray> batch(kSteps * kSteps);
  std::vector<Hit> hits(batch.size());
  const std::vector<float> limits(batch.size(), std::numeric_limits<float>::infinity());
  for (int y = 0; y < rays.height(); ++y) {
    for (int x = 0; x < rays.width(); ++x) {
      for (int i = 0; i < kSteps * kSteps; ++i) {
        batch[static_cast<std::size_t>(i)] =
            rays.ray(x, y, (static_cast<float>(i % kSteps) + 0.5F) / kSteps,
                     (static_cast<float>(i / kSteps) + 0.5F) / kSteps);
      }
      world.trace_moving(batch, limits, hits);
      const auto met = std::ranges::count_if(hits, [](const Hit& hit) { return hit.part >= 0; });
      coverage.push_back(static_cast<double>(met) / (kSteps * kSteps));
    }
  }
  return coverage;
}

}  // namespace raystage::testing
