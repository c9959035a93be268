// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

namespace raystage::rig {

/// A point of an integer grid. Coordinates are within +-2^26: predicates are exact in 128 bits.
struct GridPoint {
  std::int64_t x = 0, y = 0;
  auto operator<=>(const GridPoint&) const = default;
};
inline constexpr std::int64_t kGridPointLimit = std::int64_t{1} << 26;

/// Three indices of points, counter-clockwise with y up.
using Triangle = std::array<int, 3>;

/// Returns +1 if a, b, c turn counter-clockwise (y up), -1 if clockwise, 0 if collinear. Exact.
int orientation(GridPoint a, GridPoint b, GridPoint c);
/// Returns, exactly, +1 for d inside the circle a, b, c (counter-clockwise), 0 on it, -1 outside.
int in_circle(GridPoint a, GridPoint b, GridPoint c, GridPoint d);

/// Returns the Delaunay triangulation of distinct points, empty if all are collinear. For four or
/// more co-circular points the result depends on their positions, not on their order. Triangles
/// start at their smallest index and are sorted. Cost: O(n^2).
std::vector<Triangle> delaunay_triangulation(std::span<const GridPoint> points);

/// Returns the same triangle, starting at its smallest index.
Triangle rotate_smallest_first(Triangle triangle);

}  // namespace raystage::rig
