// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

namespace raystage {

/// A point on an integer grid; coordinates within +-2^26, so that the predicates are exact in 128
/// bits.
struct GridPoint {
  std::int64_t x = 0, y = 0;
  auto operator<=>(const GridPoint&) const = default;
};
inline constexpr std::int64_t kGridPointLimit = std::int64_t{1} << 26;

/// Three indices, counter-clockwise with y up.
using Triangle = std::array<int, 3>;

/// +1 where a, b, c turn counter-clockwise (y up), -1 clockwise, 0 collinear. Exact.
int orientation(GridPoint a, GridPoint b, GridPoint c);
/// +1 where d lies within the circle through a, b, c (counter-clockwise), -1 outside, 0 on it.
/// Exact.
int in_circle(GridPoint a, GridPoint b, GridPoint c, GridPoint d);

/// Delaunay triangulation of distinct points; empty where all are collinear. Where four or more are
/// co-circular, the choice depends on positions alone, not on the order of the points. Triangles
/// start at their smallest index and are sorted. Takes O(n^2).
std::vector<Triangle> delaunay_triangulation(std::span<const GridPoint> points);

/// The same triangle starting at its smallest index.
Triangle rotate_smallest_first(Triangle triangle);

}  // namespace raystage
