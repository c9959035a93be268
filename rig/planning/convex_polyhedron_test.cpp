// SPDX-License-Identifier: Apache-2.0
#include "rig/planning/convex_polyhedron.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <random>

namespace raystage::rig {
namespace {

std::vector<HalfSpace> cube(double half) {
  std::vector<HalfSpace> sides;
  for (int axis = 0; axis < 3; ++axis) {
    sides.push_back({Eigen::Vector3d::Unit(axis), half});
    sides.push_back({-Eigen::Vector3d::Unit(axis), half});
  }
  return sides;
}

/// The slow reference: the points where three planes meet that are in all half-spaces.
std::vector<Eigen::Vector3d> vertices_reference(const std::vector<HalfSpace>& sides) {
  std::vector<Eigen::Vector3d> vertices;
  for (std::size_t i = 0; i < sides.size(); ++i) {
    for (std::size_t j = i + 1; j < sides.size(); ++j) {
      for (std::size_t k = j + 1; k < sides.size(); ++k) {
        Eigen::Matrix3d normals;
        normals << sides[i].normal.transpose(), sides[j].normal.transpose(),
            sides[k].normal.transpose();
        if (std::abs(normals.determinant()) < 1e-6) continue;
        const Eigen::Vector3d point =
            normals.inverse() * Eigen::Vector3d(sides[i].offset, sides[j].offset, sides[k].offset);
        const bool is_inside = std::ranges::all_of(
            sides, [&](const HalfSpace& side) { return side.depth_of(point) > -1e-9; });
        const bool is_new = std::ranges::none_of(
            vertices, [&](const Eigen::Vector3d& other) { return (other - point).norm() < 1e-8; });
        if (is_inside && is_new) vertices.push_back(point);
      }
    }
  }
  return vertices;
}

void expect_same_points(const std::vector<Eigen::Vector3d>& found,
                        const std::vector<Eigen::Vector3d>& expected) {
  EXPECT_EQ(found.size(), expected.size());
  for (const Eigen::Vector3d& point : expected) {
    double nearest = std::numeric_limits<double>::infinity();
    for (const Eigen::Vector3d& other : found) nearest = std::min(nearest, (other - point).norm());
    EXPECT_LT(nearest, 1e-8) << point.transpose();
  }
}

/// Each edge has two faces, which run along it in opposite directions, and V - E + F = 2.
void expect_closed(const ConvexPolyhedron& polyhedron) {
  std::map<std::pair<int, int>, int> edges;
  for (const auto& face : polyhedron.faces()) {
    for (std::size_t i = 0; i < face.vertices.size(); ++i) {
      ++edges[{face.vertices[i], face.vertices[(i + 1) % face.vertices.size()]}];
    }
    for (const int v : face.vertices) {
      EXPECT_NEAR(face.half_space.depth_of(polyhedron.vertices()[v]), 0, 1e-9);
    }
  }
  for (const auto& [edge, count] : edges) {
    EXPECT_EQ(count, 1);
    EXPECT_TRUE(edges.contains({edge.second, edge.first}));
  }
  EXPECT_EQ(polyhedron.vertices().size() + polyhedron.faces().size(), edges.size() / 2 + 2);
}

TEST(ConvexPolyhedron, ACubeHasItsVerticesAndVolume) {
  const ConvexPolyhedron polyhedron(cube(0.5), 10);
  EXPECT_EQ(polyhedron.vertices().size(), 8U);
  EXPECT_EQ(polyhedron.faces().size(), 6U);
  EXPECT_DOUBLE_EQ(polyhedron.volume(), 1);
  EXPECT_FALSE(polyhedron.is_cut_by_box());
  expect_closed(polyhedron);
  EXPECT_DOUBLE_EQ(polyhedron.signed_distance({0.1, 0, 0}), 0.4);
  EXPECT_DOUBLE_EQ(polyhedron.signed_distance({1.5, 1.5, 0}), -std::sqrt(2));
  EXPECT_LT((polyhedron.nearest_point({2, 0.2, 0}) - Eigen::Vector3d(0.5, 0.2, 0)).norm(), 1e-15);
}

TEST(ConvexPolyhedron, EqualsTheReferenceForRandomHalfSpaces) {
  std::mt19937 random(1);  // NOLINT: the same in every run
  std::normal_distribution<double> normal;
  for (int repetition = 0; repetition < 200; ++repetition) {
    std::vector<HalfSpace> sides = cube(1);
    for (int i = 0; i < 1 + repetition % 14; ++i) {
      const Eigen::Vector3d direction(normal(random), normal(random), normal(random));
      sides.push_back(half_space(direction, direction.norm() * 0.5 * std::abs(normal(random))));
    }
    const ConvexPolyhedron polyhedron(sides, 10);
    expect_same_points(polyhedron.vertices(), vertices_reference(sides));
    expect_closed(polyhedron);
    for (int i = 0; i < 20; ++i) {
      const Eigen::Vector3d point(normal(random), normal(random), normal(random));
      double depth = std::numeric_limits<double>::infinity();
      for (const HalfSpace& side : sides) depth = std::min(depth, side.depth_of(point));
      const double distance = polyhedron.signed_distance(point);
      if (depth >= 0) {
        EXPECT_NEAR(distance, depth, 1e-12);
        continue;
      }
      EXPECT_LE(distance, depth + 1e-12) << "no plane is farther than the nearest point";
      const Eigen::Vector3d nearest = polyhedron.nearest_point(point);
      for (const HalfSpace& side : sides) EXPECT_GT(side.depth_of(nearest), -1e-9);
      // No vertex is on the near side of the plane through the nearest point.
      for (const Eigen::Vector3d& vertex : polyhedron.vertices()) {
        EXPECT_GT((vertex - nearest).dot(nearest - point), -1e-9);
      }
    }
  }
}

TEST(ConvexPolyhedron, MayBeEmptyFlatOrCutByTheBox) {
  std::vector<HalfSpace> sides = cube(1);
  sides.push_back({Eigen::Vector3d::UnitX(), -2});
  const ConvexPolyhedron empty(sides, 10);
  EXPECT_TRUE(empty.is_empty());
  EXPECT_EQ(empty.volume(), 0);
  EXPECT_EQ(empty.signed_distance({0, 0, 0}), -std::numeric_limits<double>::infinity());

  sides = cube(1);
  sides.push_back({Eigen::Vector3d::UnitY(), 0.25});
  sides.push_back({-Eigen::Vector3d::UnitY(), -0.25});
  const ConvexPolyhedron flat(sides, 10);
  EXPECT_EQ(flat.vertices().size(), 4U);
  EXPECT_EQ(flat.faces().size(), 2U);
  EXPECT_EQ(flat.volume(), 0);
  EXPECT_DOUBLE_EQ(flat.signed_distance({0, 1.25, 0}), -1);

  const ConvexPolyhedron open(std::vector<HalfSpace>{{Eigen::Vector3d::UnitX(), 0}}, 10);
  EXPECT_TRUE(open.is_cut_by_box());
  EXPECT_DOUBLE_EQ(open.volume(), 4000);
}

// Planes that many vertices share, as those of a square array have them.
TEST(ConvexPolyhedron, APyramidHasOneApex) {
  std::vector<HalfSpace> sides{{-Eigen::Vector3d::UnitZ(), 0}};
  for (const Eigen::Vector3d& out : {Eigen::Vector3d(1, 0, 1), Eigen::Vector3d(-1, 0, 1),
                                     Eigen::Vector3d(0, 1, 1), Eigen::Vector3d(0, -1, 1)}) {
    sides.push_back(half_space(out, 1));
    sides.push_back(half_space(out, 1));  // stated twice
  }
  const ConvexPolyhedron pyramid(sides, 100);
  EXPECT_EQ(pyramid.vertices().size(), 5U);
  EXPECT_EQ(pyramid.faces().size(), 5U);
  EXPECT_NEAR(pyramid.volume(), 4.0 / 3, 1e-12);
  expect_closed(pyramid);
}

}  // namespace
}  // namespace raystage::rig
