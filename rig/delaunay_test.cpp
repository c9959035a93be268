// SPDX-License-Identifier: Apache-2.0
#include "rig/delaunay.h"

#include <gtest/gtest.h>
#include <rapidcheck.h>

#include <algorithm>
#include <map>
#include <set>
#include <utility>

namespace raystage::rig {
namespace {

std::int64_t doubled_area(GridPoint a, GridPoint b, GridPoint c) {
  return (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
}

// Returns twice the area of the convex hull (Andrew's monotone chain).
std::int64_t doubled_hull_area(std::vector<GridPoint> points) {
  std::ranges::sort(points);
  std::vector<GridPoint> hull;
  for (int side = 0; side < 2; ++side) {
    const std::size_t start = hull.size();
    for (const GridPoint& p : points) {
      while (hull.size() >= start + 2 && orientation(hull[hull.size() - 2], hull.back(), p) <= 0) {
        hull.pop_back();
      }
      hull.push_back(p);
    }
    hull.pop_back();
    std::ranges::reverse(points);
  }
  std::int64_t area = 0;
  for (std::size_t i = 0; i < hull.size(); ++i) {
    const GridPoint a = hull[i], b = hull[(i + 1) % hull.size()];
    area += a.x * b.y - a.y * b.x;
  }
  return area;
}

// Returns the violated property of a Delaunay triangulation, or an empty text.
std::string what_is_wrong(const std::vector<GridPoint>& points,
                          const std::vector<Triangle>& triangles) {
  const auto at = [&](int i) { return points[i]; };
  std::map<std::pair<int, int>, int> edges;
  std::set<int> used;
  std::int64_t area = 0;
  for (const Triangle& t : triangles) {
    if (orientation(at(t[0]), at(t[1]), at(t[2])) <= 0)
      return "a triangle is not counter-clockwise";
    area += doubled_area(at(t[0]), at(t[1]), at(t[2]));
    for (std::size_t i = 0; i < 3; ++i) {
      used.insert(t[i]);
      if (++edges[{t[i], t[(i + 1) % 3]}] > 1) return "an edge is used twice in one direction";
    }
    for (const GridPoint& p : points) {
      if (in_circle(at(t[0]), at(t[1]), at(t[2]), p) > 0) return "a circumcircle is not empty";
    }
  }
  if (used.size() != points.size()) return "a point is in no triangle";
  if (area != doubled_hull_area(points)) return "the triangles do not fill the hull";
  std::size_t undirected = 0;
  for (const auto& [edge, count] : edges) {
    undirected += edge.first < edge.second || !edges.contains({edge.second, edge.first}) ? 1 : 0;
  }
  if (points.size() + triangles.size() != undirected + 1) return "Euler's count is wrong";
  return "";
}

TEST(Delaunay, PredicatesAreExactAtTheLimit) {
  const std::int64_t l = kGridPointLimit;
  EXPECT_EQ(orientation({-l, -l}, {l, l - 1}, {0, 0}), 1);
  EXPECT_EQ(orientation({-l, -l}, {l, l}, {0, 0}), 0);
  EXPECT_EQ(in_circle({-l, -l}, {l, -l}, {l, l}, {-l, l}), 0);
  EXPECT_EQ(in_circle({-l, -l}, {l, -l}, {l, l}, {-l + 1, l}), 1);
  EXPECT_EQ(in_circle({-l, -l}, {l, -l}, {l, l - 1}, {-l, l}), -1);
}

TEST(Delaunay, NothingOfCollinearPoints) {
  EXPECT_TRUE(delaunay_triangulation({}).empty());
  const std::vector<GridPoint> line{{0, 0}, {2, 4}, {1, 2}, {5, 10}};
  EXPECT_TRUE(delaunay_triangulation(line).empty());
}

TEST(Delaunay, RegularGrid) {
  std::vector<GridPoint> points;
  for (int row = 0; row < 8; ++row) {
    for (int column = 0; column < 8; ++column) points.push_back({column * 1000, row * 1000});
  }
  const auto triangles = delaunay_triangulation(points);
  EXPECT_EQ(triangles.size(), 98U);
  EXPECT_EQ(what_is_wrong(points, triangles), "");
}

TEST(Delaunay, DoesNotDependOnTheOrderOfThePoints) {
  std::vector<GridPoint> points;
  for (int row = 0; row < 5; ++row) {
    for (int column = 0; column < 6; ++column) points.push_back({column * 10, row * 10});
  }
  const auto cells = [](const std::vector<GridPoint>& p) {
    std::set<std::set<GridPoint>> result;
    for (const Triangle& t : delaunay_triangulation(p)) {
      std::set<GridPoint> corners;
      for (const int i : t) corners.insert(p[i]);
      result.insert(corners);
    }
    return result;
  };
  std::vector<GridPoint> reversed(points.rbegin(), points.rend());
  EXPECT_EQ(cells(points), cells(reversed));
}

TEST(DelaunayProperty, IsDelaunay) {
  EXPECT_TRUE(rc::check("random and degenerate sets", [] {
    // Small ranges make many points collinear and co-circular, large ones none.
    const int range = *rc::gen::element(3, 8, 40, 1 << 26);
    const auto coordinates = *rc::gen::container<std::vector<std::pair<int, int>>>(
        rc::gen::pair(rc::gen::inRange(-range, range + 1), rc::gen::inRange(-range, range + 1)));
    std::set<GridPoint> distinct;
    for (const auto& [x, y] : coordinates) distinct.insert({x, y});
    const std::vector<GridPoint> points(distinct.begin(), distinct.end());
    const auto triangles = delaunay_triangulation(points);
    if (triangles.empty()) {
      for (std::size_t i = 2; i < points.size(); ++i) {
        RC_ASSERT(orientation(points[0], points[1], points[i]) == 0);
      }
    } else {
      RC_ASSERT(what_is_wrong(points, triangles) == "");
    }
  }));
}

}  // namespace
}  // namespace raystage::rig
