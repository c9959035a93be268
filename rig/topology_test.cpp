// SPDX-License-Identifier: Apache-2.0
#include "rig/topology.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <map>
#include <random>
#include <set>
#include <utility>
#include <vector>

#include "base/error.h"

namespace raystage::rig {
namespace {

using ::testing::ElementsAre;
using Points = std::vector<Eigen::Vector3d>;

Points looking(std::size_t count, const Eigen::Vector3d& direction = {0, 0, -1}) {
  return Points(count, direction);
}

Topology delaunay(const Points& centres) {
  return delaunay_topology(centres, looking(centres.size()));
}

Points grid(int rows, int columns, double spacing, const Eigen::Vector3d& origin = {0, 0, 0}) {
  Points points;
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      points.push_back(origin + spacing * Eigen::Vector3d(column, -row, 0));
    }
  }
  return points;
}

double area(const Topology& topology, const Points& centres) {
  double sum = 0;
  for (const auto& cell : topology.cells) {
    const auto corner = [&](std::size_t i) { return centres[cell[i]]; };
    const double doubled =
        topology.normal.dot((corner(1) - corner(0)).cross(corner(2) - corner(0)));
    EXPECT_GT(doubled, 0) << "not counter-clockwise as seen from the normal's side";
    sum += doubled / 2;
  }
  return sum;
}

// Checks that each directed edge is in at most one triangle and that the border is one closed ring.
// Also checks that every centre of `expected` (all by default) is a corner.
void expect_watertight(const Topology& topology, std::size_t expected) {
  ASSERT_EQ(topology.kind, Topology::Kind::kTriangles);
  std::set<std::pair<int, int>> edges;
  std::set<int> corners;
  for (const auto& cell : topology.cells) {
    for (std::size_t i = 0; i < 3; ++i) {
      corners.insert(cell[i]);
      EXPECT_TRUE(edges.insert({cell[i], cell[(i + 1) % 3]}).second);
    }
  }
  EXPECT_EQ(corners.size(), expected);
  std::map<int, int> border;
  for (const auto& [from, to] : edges) {
    if (!edges.contains({to, from})) {
      EXPECT_TRUE(border.emplace(from, to).second);
    }
  }
  ASSERT_FALSE(border.empty());
  std::size_t steps = 0;
  int at = border.begin()->first;
  do {
    at = border.at(at);
    ++steps;
  } while (at != border.begin()->first && steps <= border.size());
  EXPECT_EQ(steps, border.size()) << "the border is not one ring: there are holes";
  // Euler: V - E + F = 1 for a disc.
  const std::size_t undirected = (edges.size() + border.size()) / 2;
  EXPECT_EQ(corners.size() + topology.cells.size(), undirected + 1);
}

TEST(DelaunayTopology, RegularGrid) {
  const Points centres = grid(8, 8, 0.06);
  const Topology topology = delaunay(centres);
  EXPECT_EQ(topology.cells.size(), 98U);
  expect_watertight(topology, 64);
  EXPECT_NEAR(area(topology, centres), 0.42 * 0.42, 1e-9);
  EXPECT_NEAR((topology.normal - Eigen::Vector3d::UnitZ()).norm(), 0, 1e-9);
}

TEST(DelaunayTopology, TurnedGridHasNoFlatBorder) {
  const Eigen::Matrix3d turn = (Eigen::AngleAxisd(0.4, Eigen::Vector3d::UnitY()) *
                                Eigen::AngleAxisd(0.3, Eigen::Vector3d(1, 2, 3).normalized()))
                                   .toRotationMatrix();
  Points centres = grid(8, 8, 0.06);
  for (auto& p : centres) p = turn * p;
  const Topology topology =
      delaunay_topology(centres, looking(64, turn * Eigen::Vector3d(0, 0, -1)));
  EXPECT_EQ(topology.cells.size(), 98U);
  expect_watertight(topology, 64);
  EXPECT_NEAR((topology.normal - turn.col(2)).norm(), 0, 1e-9);
}

TEST(DelaunayTopology, AnyScaleAndPlace) {
  for (const double spacing : {1e-6, 0.06, 1e4, 1e9}) {
    const Points centres = grid(4, 5, spacing);
    expect_watertight(delaunay(centres), 20);
    EXPECT_EQ(delaunay(centres).cells.size(), 24U) << spacing;
  }
  // At 10 000 km from the origin a double resolves 2 nm.
  expect_watertight(delaunay(grid(4, 5, 0.06, {1e7, -1e7, 1e7})), 20);
}

TEST(DelaunayTopology, RandomClouds) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> uniform(-1, 1);
  for (int count = 3; count < 200; count += 13) {
    Points centres;
    for (int i = 0; i < count; ++i) {
      centres.emplace_back(uniform(random), uniform(random), 0.05 * uniform(random));
    }
    const Topology topology = delaunay(centres);
    expect_watertight(topology, centres.size());
    EXPECT_GT(area(topology, centres), 0);
  }
}

TEST(DelaunayTopology, ThousandCameras) {
  const Points centres = grid(25, 40, 0.06);
  expect_watertight(delaunay(centres), 1000);
}

TEST(DelaunayTopology, OneCamera) {
  const Topology topology = delaunay({{1, 2, 3}});
  EXPECT_EQ(topology.kind, Topology::Kind::kPoint);
  EXPECT_THAT(topology.cells, ElementsAre(Topology::Cell{0, -1, -1}));
  EXPECT_EQ(topology.normal, Eigen::Vector3d::UnitZ());
}

TEST(DelaunayTopology, CoincidentCameras) {
  const Topology topology = delaunay({{1, 2, 3}, {1, 2, 3}, {1, 2, 3}});
  EXPECT_EQ(topology.kind, Topology::Kind::kPoint);
  EXPECT_THAT(topology.cells, ElementsAre(Topology::Cell{0, -1, -1}));
}

TEST(DelaunayTopology, TheFirstOfCoincidentCamerasStandsForThem) {
  Points centres = grid(2, 2, 1);
  centres.insert(centres.begin() + 1, Eigen::Vector3d(1e-12, 0, 0));
  centres.push_back(centres.back());
  const Topology topology = delaunay(centres);
  EXPECT_EQ(topology.cells.size(), 2U);
  for (const auto& cell : topology.cells) {
    for (const int corner : cell) EXPECT_TRUE(corner != 1 && corner != 5);
  }
}

TEST(DelaunayTopology, Line) {
  const Topology topology = delaunay({{3, 0, 0}, {0, 0, 0}, {1, 1e-9, 0}, {1, 0, 0}, {7, 0, 0}});
  EXPECT_EQ(topology.kind, Topology::Kind::kSegments);
  EXPECT_THAT(topology.cells, ElementsAre(Topology::Cell{1, 2, -1}, Topology::Cell{2, 0, -1},
                                          Topology::Cell{0, 4, -1}));
  EXPECT_NEAR((topology.normal - Eigen::Vector3d::UnitZ()).norm(), 0, 1e-9);
  EXPECT_NEAR((topology.up - Eigen::Vector3d::UnitY()).norm(), 0, 1e-9);
}

TEST(DelaunayTopology, LineAlongTheViewingDirection) {
  const Topology topology = delaunay({{0, 0, 0}, {0, 0, 1}, {0, 0, 2}});
  EXPECT_EQ(topology.kind, Topology::Kind::kSegments);
  EXPECT_NEAR(topology.normal.z(), 0, 1e-9);
  EXPECT_NEAR(topology.normal.norm(), 1, 1e-12);
  EXPECT_NEAR(topology.up.dot(topology.normal), 0, 1e-12);
}

TEST(DelaunayTopology, NearlyALine) {
  Points centres;
  for (int i = 0; i < 11; ++i) centres.emplace_back(i * 0.1, i % 2 == 0 ? 0 : 1e-8, 0);
  EXPECT_EQ(delaunay(centres).kind, Topology::Kind::kSegments);
  for (auto& p : centres) p.y() *= 100;
  EXPECT_EQ(delaunay(centres).kind, Topology::Kind::kSegments);
  for (auto& p : centres) p.y() *= 11000;  // to 0.11 of the spacing
  const Topology topology = delaunay(centres);
  expect_watertight(topology, 11);
  EXPECT_NEAR(std::abs(topology.normal.z()), 1, 1e-6);
}

TEST(DelaunayTopology, ARowThatScattersIsARowInItsOrder) {
  std::mt19937_64 random(3);
  std::uniform_real_distribution<double> scatter(-0.049, 0.049);
  for (int i = 0; i < 100; ++i) {
    Points centres;
    // Perpendicular scatter of less than 0.1 in all directions; the spacing is at least 1.
    for (int c = 0; c < 7; ++c) {
      centres.emplace_back(1.0 * c * (1 + 0.1 * c), scatter(random) * 0.7, scatter(random) * 0.7);
    }
    const Topology topology = delaunay(centres);
    ASSERT_EQ(topology.kind, Topology::Kind::kSegments);
    ASSERT_EQ(topology.cells.size(), 6U);
    for (int c = 0; c < 6; ++c) {
      EXPECT_EQ(topology.cells[static_cast<std::size_t>(c)], (Topology::Cell{c, c + 1, -1}));
    }
    EXPECT_GT(topology.normal.z(), 0.99);
    EXPECT_GT(topology.up.y(), 0.99);
  }
}

TEST(DelaunayTopology, ACameraNextToAnotherOneKeepsTheRow) {
  std::mt19937_64 random(4);
  std::uniform_real_distribution<double> scatter(-0.001, 0.001);
  for (const bool all : {false, true}) {
    Points centres;
    for (int c = 0; c < 8; ++c) centres.emplace_back(0.06 * c, scatter(random), scatter(random));
    for (std::size_t c = all ? 0 : 3; c < (all ? 8U : 4U); ++c) {
      const Eigen::Vector3d off(scatter(random), scatter(random), scatter(random));
      centres.emplace_back(centres[c] + 0.0003 * off.normalized());
    }
    const Topology topology = delaunay(centres);
    ASSERT_EQ(topology.kind, Topology::Kind::kSegments) << all;
    ASSERT_EQ(topology.cells.size(), 7U);
    for (int c = 0; c < 7; ++c) {
      EXPECT_EQ(topology.cells[static_cast<std::size_t>(c)], (Topology::Cell{c, c + 1, -1}));
    }
    EXPECT_GT(topology.normal.z(), 0.99);
  }
}

TEST(DelaunayTopology, CamerasOneAboveTheOtherAreNoRow) {
  // Two columns far apart: the spacing along the long axis is 0 within a column.
  EXPECT_EQ(delaunay({{0, 0, 0}, {0, 1, 0}, {1000, 0, 0}, {1000, 1, 0}}).kind,
            Topology::Kind::kTriangles);
  EXPECT_EQ(delaunay({{0, 0, 0}, {1, 0.2, 0}, {2, 0, 0}, {3, 0.2, 0}}).kind,
            Topology::Kind::kTriangles);
}

TEST(DelaunayTopology, CamerasOnAnArc) {
  // Like fountain-P11: a horizontal arc around the subject with slightly uneven heights.
  Points centres, directions;
  for (int i = 0; i < 11; ++i) {
    const double angle = -0.9 + 0.18 * i;
    centres.emplace_back(8 * std::sin(angle), 0.03 * ((i * 7) % 5), 8 * std::cos(angle));
    directions.emplace_back(-std::sin(angle), 0, -std::cos(angle));
  }
  const Topology topology = delaunay_topology(centres, directions);
  expect_watertight(topology, 11);
}

TEST(DelaunayTopology, RefusesNothingAndNonFinite) {
  EXPECT_THROW(delaunay({}), Error);
  EXPECT_THROW(delaunay({{0, 0, 0}, {std::nan(""), 0, 0}}), Error);
}

struct Grid {
  Points centres;
  std::vector<int> rows, columns;
};

// Returns a grid. `absent`: row * 100 + column of positions without a camera.
Grid places(int rows, int columns, const std::set<int>& absent, double error = 0) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> uniform(-error, error);
  Grid result;
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      const Eigen::Vector3d shift(uniform(random), uniform(random), uniform(random));
      if (absent.contains(row * 100 + column)) continue;
      result.centres.push_back(Eigen::Vector3d(0.06 * column, -0.06 * row, 0) + shift);
      result.rows.push_back(row);
      result.columns.push_back(column);
    }
  }
  return result;
}

Topology topology_of_grid(const Grid& g) {
  return grid_topology(g.centres, looking(g.centres.size()), g.rows, g.columns);
}

TEST(GridTopology, SplitsEqualDiagonalsFromLowToHigh) {
  const Grid g = places(8, 8, {});
  const Topology topology = topology_of_grid(g);
  EXPECT_EQ(topology.cells.size(), 98U);
  expect_watertight(topology, 64);
  EXPECT_NEAR(area(topology, g.centres), 0.42 * 0.42, 1e-12);
  for (const auto& cell : topology.cells) {
    // The diagonal connects (row, column) and (row + 1, column + 1).
    std::set<int> corners(cell.begin(), cell.end());
    EXPECT_TRUE(corners.contains(*corners.begin() + 9));
  }
}

TEST(GridTopology, SplitsTheShorterDiagonal) {
  Grid g = places(2, 2, {});
  g.centres[0] += Eigen::Vector3d(-0.02, 0.02, 0);  // stretches the default diagonal
  const Topology topology = topology_of_grid(g);
  EXPECT_THAT(topology.cells, ElementsAre(Topology::Cell{0, 2, 1}, Topology::Cell{1, 2, 3}));
}

TEST(GridTopology, MountingErrorsKeepTheGrid) {
  const Grid g = places(8, 8, {}, 0.003);
  const Topology topology = topology_of_grid(g);
  EXPECT_EQ(topology.cells.size(), 98U);
  expect_watertight(topology, 64);
  area(topology, g.centres);
}

TEST(GridTopology, ClosesHoles) {
  // A single hole inside, a pair inside, one on the border, one at a corner.
  for (const std::set<int>& absent : {std::set<int>{202},
                                      {202, 203},
                                      {3},
                                      {0},
                                      {0, 3, 202, 505},
                                      {101, 102, 201, 202, 303},
                                      {0, 1, 2, 3, 4, 5, 6, 7}}) {
    for (const double error : {0.0, 0.003}) {
      const Grid g = places(8, 8, absent, error);
      const Topology topology = topology_of_grid(g);
      expect_watertight(topology, 64 - absent.size());
      if (error == 0 && *absent.begin() >= 100) {
        EXPECT_NEAR(area(topology, g.centres), 0.42 * 0.42, 1e-9);
      } else {
        area(topology, g.centres);
      }
    }
  }
}

TEST(GridTopology, FallsBackToDelaunay) {
  Grid repeated = places(3, 3, {});
  repeated.rows[4] = 0;
  repeated.columns[4] = 0;
  EXPECT_EQ(topology_of_grid(repeated).cells.size(), 8U);

  const Grid line = places(1, 5, {});
  EXPECT_EQ(topology_of_grid(line).kind, Topology::Kind::kSegments);

  Grid shuffled = places(3, 3, {});
  std::swap(shuffled.centres[0], shuffled.centres[8]);
  const Topology topology = topology_of_grid(shuffled);
  expect_watertight(topology, 9);
  EXPECT_NEAR(area(topology, shuffled.centres), 0.12 * 0.12, 1e-9);
}

}  // namespace
}  // namespace raystage::rig
