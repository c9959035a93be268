// SPDX-License-Identifier: Apache-2.0
// The cells of spheres, domes and rings against what any closed surface of triangles must fulfil.
#include "rig/outward_topology.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <map>
#include <numbers>
#include <random>
#include <set>
#include <vector>

namespace raystage::rig {
namespace {

using Eigen::Vector3d;

std::vector<Vector3d> directions_of(const std::vector<Vector3d>& centres, const Vector3d& middle) {
  std::vector<Vector3d> directions;
  for (const Vector3d& centre : centres) directions.push_back((centre - middle).normalized());
  return directions;
}

/// Returns `count` points spread over a sphere of radius 1 (a golden spiral), from the height
/// `lowest`.
std::vector<Vector3d> spiral(int count, double lowest) {
  std::vector<Vector3d> points;
  for (int i = 0; i < count; ++i) {
    const double height = 1 - (1 - lowest) * (i + 0.5) / count;
    const double turn = i * std::numbers::pi * (3 - std::sqrt(5.0));
    const double radius = std::sqrt(1 - height * height);
    points.emplace_back(radius * std::cos(turn), height, radius * std::sin(turn));
  }
  return points;
}

/// Checks that the triangles close a surface that has `corners` corners and the mean inside.
void expect_closed(const Topology& topology, const std::vector<Vector3d>& centres,
                   std::size_t corners) {
  ASSERT_EQ(topology.kind, Topology::Kind::kTriangles);
  EXPECT_TRUE(topology.outwards);
  Vector3d middle = Vector3d::Zero();
  for (const Vector3d& centre : centres) middle += centre / static_cast<double>(centres.size());
  std::set<std::pair<int, int>> edges;
  std::set<int> used;
  for (const Topology::Cell& t : topology.cells) {
    for (std::size_t i = 0; i < 3; ++i) {
      EXPECT_TRUE(edges.insert({t[i], t[(i + 1) % 3]}).second) << "an edge in two triangles";
      used.insert(t[i]);
    }
    const Vector3d a = centres[t[0]] - middle, b = centres[t[1]] - middle,
                   c = centres[t[2]] - middle;
    EXPECT_GT(a.normalized().dot(b.normalized().cross(c.normalized())), -1e-6) << "turned inside";
  }
  for (const auto& [from, to] : edges) EXPECT_TRUE(edges.contains({to, from})) << "an open edge";
  EXPECT_EQ(used.size(), corners);
  EXPECT_EQ(topology.cells.size(), 2 * corners - 4) << "Euler's formula";
}

TEST(OutwardTopology, SpheresAndDomesAreClosed) {
  for (const int count : {4, 6, 16, 46, 200}) {
    for (const double lowest : {-1.0, 0.0}) {
      if (lowest == 0 && count < 16) continue;
      const std::vector<Vector3d> centres = spiral(count, lowest);
      const auto topology = outward_topology(centres, directions_of(centres, Vector3d::Zero()));
      ASSERT_TRUE(topology) << count << ' ' << lowest;
      expect_closed(*topology, centres, centres.size());
    }
  }
}

TEST(OutwardTopology, DirectionsOnOneCircleAreTriangulatedOnce) {
  std::vector<Vector3d> cube;  // four directions on a circle per side
  for (int corner = 0; corner < 8; ++corner) {
    cube.emplace_back(corner & 1 ? 1 : -1, corner & 2 ? 1 : -1, corner & 4 ? 1 : -1);
  }
  const auto topology = outward_topology(cube, directions_of(cube, Vector3d::Zero()));
  ASSERT_TRUE(topology);
  expect_closed(*topology, cube, 8);
}

TEST(OutwardTopology, TrianglesAreThoseOfTheConvexHull) {
  const std::vector<Vector3d> centres = spiral(40, -1);
  const auto topology = outward_topology(centres, directions_of(centres, Vector3d::Zero()));
  ASSERT_TRUE(topology);
  for (const Topology::Cell& t : topology->cells) {
    const Vector3d normal =
        (centres[t[1]] - centres[t[0]]).cross(centres[t[2]] - centres[t[0]]).normalized();
    for (const Vector3d& other : centres) EXPECT_LT(normal.dot(other - centres[t[0]]), 0.02);
  }
}

TEST(OutwardTopology, ACameraBehindAnotherIsLeftOut) {
  std::vector<Vector3d> centres = spiral(20, -1);
  const std::vector<Vector3d> alone = directions_of(centres, Vector3d::Zero());
  centres.push_back(centres[3] * 1.00001);  // not coincident, and the mean stays where it is
  const auto topology = outward_topology(centres, directions_of(centres, Vector3d::Zero()));
  ASSERT_TRUE(topology);
  expect_closed(*topology, centres, 20);
}

TEST(OutwardTopology, ARingIsClosedByStrips) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> off(-1, 1);
  std::vector<Vector3d> centres;
  for (int i = 0; i < 8; ++i) {
    const double turn = 2 * std::numbers::pi * i / 8;
    centres.emplace_back(std::cos(turn), 0.01 * off(random), std::sin(turn));
  }
  const auto topology = outward_topology(centres, directions_of(centres, Vector3d::Zero()));
  ASSERT_TRUE(topology);
  EXPECT_EQ(topology->kind, Topology::Kind::kSegments);
  EXPECT_TRUE(topology->outwards);
  ASSERT_EQ(topology->cells.size(), 8U);
  std::map<int, int> next;
  for (const Topology::Cell& cell : topology->cells) {
    next[cell[0]] = cell[1];
    EXPECT_EQ(cell[2], -1);
    const Vector3d leaving = (centres[cell[1]] - centres[cell[0]]).cross(topology->up);
    EXPECT_GT(leaving.dot(centres[cell[0]] + centres[cell[1]]), 0);
  }
  int at = 0;
  for (int i = 0; i < 8; ++i) at = next.at(at);
  EXPECT_EQ(at, 0);
  EXPECT_EQ(next.size(), 8U);
}

TEST(OutwardTopology, ACameraNextToAnotherOneKeepsTheRing) {
  for (const bool is_behind : {false, true}) {
    std::vector<Vector3d> centres;
    for (int i = 0; i < 8; ++i) {
      const double turn = 2 * std::numbers::pi * i / 8;
      centres.emplace_back(std::cos(turn), 0.01 * (i % 2), std::sin(turn));
    }
    const Vector3d off = is_behind ? Vector3d(-0.003, 0, 0) : Vector3d(0, -0.003, 0);
    centres.push_back(centres[0] + off);
    const auto topology = outward_topology(centres, directions_of(centres, Vector3d::Zero()));
    ASSERT_TRUE(topology);
    EXPECT_EQ(topology->kind, Topology::Kind::kSegments);
    EXPECT_EQ(topology->cells.size(), 8U);
    for (const Topology::Cell& cell : topology->cells) EXPECT_LT(std::max(cell[0], cell[1]), 8);
  }
}

TEST(OutwardTopology, OtherArraysHaveNone) {
  const Vector3d ahead = -Vector3d::UnitZ();
  std::vector<Vector3d> grid, inwards = spiral(30, -1), towards;
  for (int i = 0; i < 16; ++i) {
    const int row = i / 4;
    grid.emplace_back(0.1 * (i % 4), 0.1 * row, 0.002 * (i % 3));
  }
  EXPECT_FALSE(outward_topology(grid, std::vector<Vector3d>(16, ahead)));
  for (const Vector3d& centre : inwards) towards.push_back(-centre);
  EXPECT_FALSE(outward_topology(inwards, towards)) << "about a stage";
  EXPECT_FALSE(outward_topology(inwards, std::vector<Vector3d>(30, ahead)));
  std::vector<Vector3d> rings;  // two in one plane, and one about a camera
  for (int i = 0; i < 16; ++i) {
    const double turn = 2 * std::numbers::pi * i / 8, radius = i < 8 ? 1 : 0.5;
    rings.emplace_back(radius * std::cos(turn), 0, radius * std::sin(turn));
  }
  EXPECT_FALSE(outward_topology(rings, directions_of(rings, Vector3d::Zero())));
  std::vector<Vector3d> about(rings.begin(), rings.begin() + 8), outwards;
  outwards = directions_of(about, Vector3d::Zero());
  about.insert(about.begin(), Vector3d::Zero());
  outwards.insert(outwards.begin(), Vector3d::UnitY());
  EXPECT_FALSE(outward_topology(about, outwards));
  const std::vector<Vector3d> line{{0, 0, 0}, {1, 0, 0}, {2, 0, 0}};
  EXPECT_FALSE(outward_topology(line, directions_of(line, {1, 0, 0.1})));
}

}  // namespace
}  // namespace raystage::rig
