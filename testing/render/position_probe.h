// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "render/sweep/cost_kernels.h"

namespace raystage::testing {

/// Where the kernels look up a pixel of a block on a plane.
struct ProbedPosition {
  double u = 0, v = 0;  ///< pixels of the camera's frame
  bool by_fit = false;  ///< by the block's parabola, else by itself
  bool seen = false;    ///< if by itself
};

/// Plane by plane of a run's, `count` pixels (kCostBlockSize at most) from `begin` on each.
/// Run-time dispatch: see cost_kernel_target().
std::vector<ProbedPosition> probe_positions(const MatchingCamera& camera, const CostRun& run,
                                            int begin, int count);

}  // namespace raystage::testing
