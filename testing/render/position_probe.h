// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "render/sweep/cost_kernels.h"

namespace raystage::testing {

/// The position at which the kernels sample a pixel of a block on a plane.
struct ProbedPosition {
  double u = 0, v = 0;  ///< pixels of the camera's frame
  bool by_fit = false;  ///< by the block's parabola, else exact
  bool seen = false;    ///< if exact
};

/// Returns the positions of `count` pixels (at most kCostBlockSize) from `begin` on, plane by
/// plane. Run-time dispatch: see cost_kernel_target().
std::vector<ProbedPosition> probe_positions(const render::MatchingCamera& camera,
                                            const render::CostRun& run, int begin, int count);

}  // namespace raystage::testing
