// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstddef>
#include <limits>
#include <vector>

#include "simulate/camera_renderer.h"
#include "simulate/world.h"

namespace raystage::testing {

/// Returns the share of each pixel, in [0, 1], that moving parts cover, from 10 x 10 rays. Assumes
/// that nothing static hides them.
inline std::vector<double> moving_part_coverage(const simulate::World& world,
                                                const simulate::PixelRays& rays) {
  constexpr int kSteps = 10;
  std::vector<double> coverage;
  std::vector<simulate::Ray> batch(kSteps * kSteps);
  std::vector<simulate::Hit> hits(batch.size());
  const std::vector<float> limits(batch.size(), std::numeric_limits<float>::infinity());
  for (int y = 0; y < rays.height(); ++y) {
    for (int x = 0; x < rays.width(); ++x) {
      for (int i = 0; i < kSteps * kSteps; ++i) {
        const int column = i % kSteps, row = i / kSteps;
        batch[i] = rays.ray(x, y, (static_cast<float>(column) + 0.5F) / kSteps,
                            (static_cast<float>(row) + 0.5F) / kSteps);
      }
      world.trace_moving(batch, limits, hits);
      const auto met =
          std::ranges::count_if(hits, [](const simulate::Hit& hit) { return hit.part >= 0; });
      coverage.push_back(static_cast<double>(met) / (kSteps * kSteps));
    }
  }
  return coverage;
}

}  // namespace raystage::testing
