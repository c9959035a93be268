// SPDX-License-Identifier: Apache-2.0
// Delaunay triangulation of n distinct integer points by incremental insertion (Bowyer 1981, Watson
// 1981). A ghost vertex outside the hull and exact 128-bit predicates keep the cavity of each new
// point connected and star-shaped. Output: triangles of indices, counter-clockwise. Cost: O(n^2).
#include "rig/delaunay.h"

#include <algorithm>
#include <cassert>
#include <numeric>
#include <utility>

namespace raystage::rig {
namespace {

__extension__ using Int128 = __int128;

constexpr int kGhost = -1;

int sign(Int128 value) { return value > 0 ? 1 : (value < 0 ? -1 : 0); }

// Returns the triangle rotated so that a ghost vertex is last. In a ghost triangle (a, b, kGhost)
// the outside of the hull is to the left of a -> b.
Triangle with_ghost_last(Triangle triangle) {
  while (triangle[2] != kGhost && (triangle[0] == kGhost || triangle[1] == kGhost)) {
    std::rotate(triangle.begin(), triangle.begin() + 1, triangle.end());
  }
  return triangle;
}

// Returns whether `p` is inside the triangle's open circumcircle. For a ghost triangle that is the
// open half-plane outside its edge, and the open edge itself.
bool conflicts(std::span<const GridPoint> points, const Triangle& triangle, GridPoint p) {
  const GridPoint a = points[triangle[0]];
  const GridPoint b = points[triangle[1]];
  if (triangle[2] == kGhost) {
    const int side = orientation(a, b, p);
    if (side != 0) return side > 0;
    return std::min(a, b) < p && p < std::max(a, b);
  }
  return in_circle(a, b, points[triangle[2]], p) > 0;
}

void insert(std::vector<Triangle>& triangles, std::span<const GridPoint> points, int index) {
  const GridPoint p = points[index];
  const auto cavity = std::partition(triangles.begin(), triangles.end(),
                                     [&](const Triangle& t) { return !conflicts(points, t, p); });
  std::vector<std::pair<int, int>> edges;
  for (auto triangle = cavity; triangle != triangles.end(); ++triangle) {
    for (std::size_t i = 0; i < 3; ++i) {
      edges.emplace_back((*triangle)[i], (*triangle)[(i + 1) % 3]);
    }
  }
  std::ranges::sort(edges);
  triangles.erase(cavity, triangles.end());
  for (const auto& [from, to] : edges) {
    if (std::ranges::binary_search(edges, std::pair(to, from))) continue;
    triangles.push_back(with_ghost_last({from, to, index}));
  }
}

}  // namespace

int orientation(GridPoint a, GridPoint b, GridPoint c) {
  return sign(Int128{b.x - a.x} * (c.y - a.y) - Int128{b.y - a.y} * (c.x - a.x));
}

int in_circle(GridPoint a, GridPoint b, GridPoint c, GridPoint d) {
  const std::int64_t ax = a.x - d.x, ay = a.y - d.y;
  const std::int64_t bx = b.x - d.x, by = b.y - d.y;
  const std::int64_t cx = c.x - d.x, cy = c.y - d.y;
  const Int128 a2 = Int128{ax} * ax + Int128{ay} * ay;
  const Int128 b2 = Int128{bx} * bx + Int128{by} * by;
  const Int128 c2 = Int128{cx} * cx + Int128{cy} * cy;
  const Int128 ab = Int128{ax} * by - Int128{ay} * bx;
  const Int128 bc = Int128{bx} * cy - Int128{by} * cx;
  const Int128 ca = Int128{cx} * ay - Int128{cy} * ax;
  return sign(a2 * bc + b2 * ca + c2 * ab);
}

Triangle rotate_smallest_first(Triangle triangle) {
  std::rotate(triangle.begin(), std::min_element(triangle.begin(), triangle.end()), triangle.end());
  return triangle;
}

std::vector<Triangle> delaunay_triangulation(std::span<const GridPoint> points) {
  assert(std::ranges::all_of(points, [](GridPoint p) {
    return std::max(std::abs(p.x), std::abs(p.y)) <= kGridPointLimit;
  }));
  std::vector<int> order(points.size());
  std::iota(order.begin(), order.end(), 0);
  const auto point = [&](int index) { return points[index]; };
  std::ranges::sort(order, {}, point);
  if (order.size() < 3) return {};

  const int first = order[0];
  const int second = order[1];
  const auto third = std::find_if(order.begin() + 2, order.end(), [&](int index) {
    return orientation(point(first), point(second), point(index)) != 0;
  });
  if (third == order.end()) return {};
  Triangle start{first, second, *third};
  if (orientation(point(first), point(second), point(*third)) < 0) std::swap(start[1], start[2]);
  std::vector<Triangle> triangles{start};
  for (std::size_t i = 0; i < 3; ++i) triangles.push_back({start[(i + 1) % 3], start[i], kGhost});
  for (const int index : order) {
    if (std::ranges::find(start, index) == start.end()) insert(triangles, points, index);
  }
  std::erase_if(triangles, [](const Triangle& t) { return t[2] == kGhost; });
  std::ranges::transform(triangles, triangles.begin(), rotate_smallest_first);
  std::ranges::sort(triangles);
  return triangles;
}

}  // namespace raystage::rig
