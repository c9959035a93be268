// SPDX-License-Identifier: Apache-2.0
// Computes limits of sampling without ghosting (thesis eq. 2.1 and 2.2). The disparity of a point
// is focal_length * spacing / depth, and a focal plane allows an error of one pixel on each side.
// Inputs: pixels, metres, and the n cells of a topology; outputs: pixels or metres. Cost: O(n).
#include "rig/plenoptic_sampling.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace raystage::rig {
namespace {

double inverse_depth_range(schemas::DepthRange range) { return 1 / range.near - 1 / range.far; }

}  // namespace

double disparity_range(double focal_length, double spacing, schemas::DepthRange range) {
  return focal_length * spacing * inverse_depth_range(range);
}

double max_alias_free_baseline(double focal_length, schemas::DepthRange range) {
  const double depths = inverse_depth_range(range);
  return depths > 0 ? kMaxAliasFreeDisparity / (focal_length * depths)
                    : std::numeric_limits<double>::infinity();
}

double alias_free_plane_count(double disparity_range) {
  // The tolerance prevents that a rounding error adds a plane to a range that fits exactly.
  return std::max(1.0, std::ceil(disparity_range / kMaxAliasFreeDisparity - 1e-9));
}

schemas::DepthRange alias_free_depth_range(double focal_length, double spacing,
                                           double focal_depth) {
  const double reach = kMaxAliasFreeDisparity / 2 / (focal_length * spacing);
  const double farthest = 1 / focal_depth - reach;
  return {1 / (1 / focal_depth + reach),
          farthest > 0 ? 1 / farthest : std::numeric_limits<double>::infinity()};
}

double max_neighbour_baseline(const Rig& rig, const Topology& topology) {
  const auto distance = [&](int a, int b) {
    return (rig.cameras[a].pose.position - rig.cameras[b].pose.position).norm();
  };
  double widest = 0;
  for (const Topology::Cell& cell : topology.cells) {
    if (cell[1] < 0) continue;
    if (cell[2] < 0) {
      widest = std::max(widest, distance(cell[0], cell[1]));
      continue;
    }
    std::array<double, 3> sides{distance(cell[0], cell[1]), distance(cell[1], cell[2]),
                                distance(cell[2], cell[0])};
    std::ranges::sort(sides);
    widest = std::max(widest, sides[1]);
  }
  return widest;
}

}  // namespace raystage::rig
