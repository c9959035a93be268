// SPDX-License-Identifier: Apache-2.0
// Builds the cells of an array (thesis 4.1.2) from its n camera centres (world, metres). Centres
// are projected onto their best-fit plane and snapped to integers. Grids: triangulation of the grid
// positions, shorter diagonals in the cells, Lawson's flips in the holes. Otherwise: Delaunay
// triangulation. Output: triangles, segments or a point, as indices of centres. Cost: O(n^2).
#include "rig/topology.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <optional>
#include <set>
#include <utility>

#include "rig/array_plane.h"
#include "rig/delaunay.h"

namespace raystage::rig {
namespace {

using Edge = std::pair<int, int>;

double length(GridPoint a, GridPoint b) {
  return std::hypot(static_cast<double>(b.x - a.x), static_cast<double>(b.y - a.y));
}

// Removes triangles on a straight border that are flat within the snapping error of one unit.
void drop_flat_border(std::vector<Triangle>& triangles, std::span<const GridPoint> points) {
  constexpr double kFlat = 2;  // units of the grid
  const auto point = [&](int index) { return points[index]; };
  bool changed = true;
  while (changed) {
    changed = false;
    std::set<Edge> edges;
    for (const Triangle& t : triangles) {
      for (std::size_t i = 0; i < 3; ++i) edges.insert({t[i], t[(i + 1) % 3]});
    }
    std::set<int> border;
    for (const auto& [from, to] : edges) {
      if (!edges.contains({to, from})) border.insert({from, to});
    }
    for (auto t = triangles.begin(); t != triangles.end() && !changed; ++t) {
      for (std::size_t i = 0; i < 3 && !changed; ++i) {
        const int from = (*t)[i], to = (*t)[(i + 1) % 3], apex = (*t)[(i + 2) % 3];
        if (edges.contains({to, from}) || border.contains(apex)) continue;
        const double base = length(point(from), point(to));
        const GridPoint a = point(from), b = point(to), c = point(apex);
        const double height = (static_cast<double>(b.x - a.x) * (c.y - a.y) -
                               static_cast<double>(b.y - a.y) * (c.x - a.x)) /
                              base;
        changed = height <= kFlat && base >= length(b, c) && base >= length(c, a);
      }
      if (changed) {
        triangles.erase(t);
        break;
      }
    }
  }
}

Topology line_topology(const ArrayPlane& plane) {
  Topology topology;
  topology.kind = Topology::Kind::kSegments;
  std::vector<int> order(plane.distinct.size());
  std::iota(order.begin(), order.end(), 0);
  std::ranges::sort(order, {}, [&](int i) { return plane.snapped[i].x; });
  for (std::size_t i = 0; i + 1 < order.size(); ++i) {
    topology.cells.push_back({plane.distinct[order[i]], plane.distinct[order[i + 1]], -1});
  }
  return topology;
}

Topology triangle_topology(const ArrayPlane& plane, std::span<const Triangle> triangles) {
  Topology topology;
  topology.kind = Topology::Kind::kTriangles;
  for (const Triangle& t : triangles) {
    const auto centre = [&](std::size_t corner) { return plane.distinct[t[corner]]; };
    topology.cells.push_back(rotate_smallest_first({centre(0), centre(1), centre(2)}));
  }
  std::ranges::sort(topology.cells);
  return topology;
}

Topology delaunay_of(const ArrayPlane& plane) {
  Topology topology;
  if (plane.dimension == 0) {
    topology.cells.push_back({plane.distinct[0], -1, -1});
  } else {
    std::vector<Triangle> triangles;
    if (plane.dimension == 2) triangles = delaunay_triangulation(plane.snapped);
    drop_flat_border(triangles, plane.snapped);
    topology = triangles.empty() ? line_topology(plane) : triangle_topology(plane, triangles);
  }
  topology.normal = plane.normal;
  topology.up = plane.up;
  return topology;
}

// Returns the rank of each value among the distinct values, so that neighbours differ by one.
std::vector<int> ranks(std::span<const int> values) {
  const std::set<int> distinct(values.begin(), values.end());
  std::map<int, int> rank;
  for (const int value : distinct) rank.emplace(value, static_cast<int>(rank.size()));
  std::vector<int> result;
  for (const int value : values) result.push_back(rank.at(value));
  return result;
}

// A triangulation with edge flips. It maps each directed edge to the opposite corner.
class EdgeFlips {
 public:
  explicit EdgeFlips(std::span<const Triangle> triangles) {
    for (const Triangle& t : triangles) add(t);
  }

  /// Returns the opposite corner of the triangle to the left of the edge, or -1 on the border.
  int across(Edge edge) const {
    const auto found = apex_.find(edge);
    return found == apex_.end() ? -1 : found->second;
  }
  /// Returns each inner edge once, from the lower to the higher index.
  std::vector<Edge> inner_edges() const {
    std::vector<Edge> edges;
    for (const auto& [edge, apex] : apex_) {
      if (edge.first < edge.second && apex_.contains({edge.second, edge.first})) {
        edges.push_back(edge);
      }
    }
    return edges;
  }
  void flip(Edge edge) {
    const auto [a, b] = edge;
    const int left = across(edge), right = across({b, a});
    remove({a, b, left});
    remove({b, a, right});
    add({right, b, left});
    add({left, a, right});
  }
  std::vector<Triangle> triangles() const {
    std::set<Triangle> result;
    for (const auto& [edge, apex] : apex_) {
      result.insert(rotate_smallest_first({edge.first, edge.second, apex}));
    }
    return {result.begin(), result.end()};
  }

 private:
  void add(const Triangle& t) {
    for (std::size_t i = 0; i < 3; ++i) apex_[{t[i], t[(i + 1) % 3]}] = t[(i + 2) % 3];
  }
  void remove(const Triangle& t) {
    for (std::size_t i = 0; i < 3; ++i) apex_.erase({t[i], t[(i + 1) % 3]});
  }

  std::map<Edge, int> apex_;
};

// Triangulates the grid positions, with edges chosen by the centres: the shorter diagonal in cells
// of four neighbours, Delaunay in the holes. Returns nullopt if positions and centres disagree.
std::optional<std::vector<Triangle>> triangulate_grid(std::span<const GridPoint> positions,
                                                      std::span<const GridPoint> centres) {
  std::vector<Triangle> flat = delaunay_triangulation(positions);
  if (flat.empty()) return std::nullopt;
  const auto at = [](std::span<const GridPoint> points, int i) { return points[i]; };
  const auto side = [&](int a, int b, int c) {
    return orientation(at(centres, a), at(centres, b), at(centres, c));
  };
  // If rows increase against `up`, every triangle has the opposite orientation.
  const int turn = side(flat[0][0], flat[0][1], flat[0][2]);
  for (const Triangle& t : flat) {
    if (turn == 0 || side(t[0], t[1], t[2]) != turn) return std::nullopt;
  }
  if (turn < 0) {
    for (Triangle& t : flat) std::swap(t[1], t[2]);
  }
  EdgeFlips mesh(flat);
  const auto convex = [&](Edge edge, int left, int right) {
    return side(right, edge.second, left) > 0 && side(left, edge.first, right) > 0;
  };
  const auto is_cell = [&](Edge edge, int left, int right) {
    const GridPoint a = at(positions, edge.first), b = at(positions, edge.second);
    const auto corner = [&](GridPoint p) {
      return (p.x == a.x && p.y == b.y) || (p.x == b.x && p.y == a.y);
    };
    return std::abs(a.x - b.x) == 1 && std::abs(a.y - b.y) == 1 && corner(at(positions, left)) &&
           corner(at(positions, right));
  };

  std::set<Edge> cell_edges;  // edges of complete cells: they are not flipped below
  for (const Edge& edge : mesh.inner_edges()) {
    const auto [a, b] = edge;
    const int left = mesh.across(edge), right = mesh.across({b, a});
    if (!is_cell(edge, left, right)) continue;
    for (const int end : {a, b}) {
      for (const int corner : {left, right}) cell_edges.insert(std::minmax(end, corner));
    }
    cell_edges.insert(std::minmax(a, b));
    cell_edges.insert(std::minmax(left, right));
    const double now = length(at(centres, a), at(centres, b));
    const double other = length(at(centres, left), at(centres, right));
    const GridPoint p = at(positions, a), q = at(positions, b);
    const bool rising = (q.x - p.x) * (q.y - p.y) > 0;
    const bool tie = std::abs(now - other) <= 4;  // the snapping error
    if ((tie ? !rising : other < now) && convex(edge, left, right)) mesh.flip(edge);
  }

  // Lawson's flips: each one brings the triangulation closer to Delaunay, so the loop terminates.
  for (bool changed = true; changed;) {
    changed = false;
    for (const Edge& edge : mesh.inner_edges()) {
      if (cell_edges.contains(edge)) continue;
      const int left = mesh.across(edge), right = mesh.across({edge.second, edge.first});
      if (left < 0 || right < 0 || !convex(edge, left, right)) continue;
      if (in_circle(at(centres, edge.first), at(centres, edge.second), at(centres, left),
                    at(centres, right)) > 0) {
        mesh.flip(edge);
        changed = true;
      }
    }
  }
  return mesh.triangles();
}

}  // namespace

Topology delaunay_topology(std::span<const Eigen::Vector3d> centres,
                           std::span<const Eigen::Vector3d> viewing_directions) {
  return delaunay_of(fit_array_plane(centres, viewing_directions));
}

Topology grid_topology(std::span<const Eigen::Vector3d> centres,
                       std::span<const Eigen::Vector3d> viewing_directions,
                       std::span<const int> rows, std::span<const int> columns) {
  const ArrayPlane plane = fit_array_plane(centres, viewing_directions);
  std::vector<GridPoint> positions;
  const std::vector<int> row_ranks = ranks(rows), column_ranks = ranks(columns);
  for (std::size_t i = 0; i < centres.size(); ++i) {
    positions.push_back({column_ranks[i], row_ranks[i]});
  }
  const std::set<GridPoint> distinct_positions(positions.begin(), positions.end());
  const bool one_each =
      plane.distinct.size() == centres.size() && distinct_positions.size() == centres.size();
  if (plane.dimension == 2 && one_each) {
    if (const auto triangles = triangulate_grid(positions, plane.snapped)) {
      Topology topology = triangle_topology(plane, *triangles);
      topology.normal = plane.normal;
      topology.up = plane.up;
      return topology;
    }
  }
  return delaunay_of(plane);
}

}  // namespace raystage::rig
