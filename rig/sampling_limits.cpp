// SPDX-License-Identifier: Apache-2.0
#include "rig/sampling_limits.h"

#include <algorithm>
#include <array>
#include <limits>

namespace raystage {
namespace {

double inverse_depth_range(DepthRange range) { return 1 / range.near - 1 / range.far; }

}  // namespace

double disparity_range(double focal_length, double spacing, DepthRange range) {
  return focal_length * spacing * inverse_depth_range(range);
}

double largest_alias_free_spacing(double focal_length, DepthRange range) {
  const double depths = inverse_depth_range(range);
  return depths > 0 ? kAliasFreeDisparity / (focal_length * depths)
                    : std::numeric_limits<double>::infinity();
}

double camera_spacing(const Rig& rig, const Topology& topology) {
  const auto distance = [&](int a, int b) {
    return (rig.cameras[static_cast<std::size_t>(a)].pose.position -
            rig.cameras[static_cast<std::size_t>(b)].pose.position)
        .norm();
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

}  // namespace raystage
