// SPDX-License-Identifier: Apache-2.0
// Sets of directions against rays that are followed one by one.
#include "rig/planning/recorded_cells.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>
#include <numeric>
#include <random>

namespace raystage::rig::recorded_cells_test {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

/// 3 x 3 cameras that are turned, distorted and nowhere quite in place.
Rig real_rig(std::mt19937& random, const schemas::Distortion& distortion) {
  std::uniform_real_distribution<double> any(-1, 1);
  Rig rig;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) {
      schemas::CameraGeometry geometry;
      geometry.id = std::to_string(3 * row + column);
      geometry.width = 640;
      geometry.height = 480;
      geometry.intrinsics = {.fx = 400, .fy = 410, .cx = 330, .cy = 235, .distortion = distortion};
      Rig::Camera camera{geometry.id, CameraModel(geometry), {}, {}, row, column};
      camera.pose.position = 0.06 * Vector3d(column - 1, row - 1, 0) +
                             0.01 * Vector3d(any(random), any(random), any(random));
      camera.pose.world_from_camera_rotation =
          (Eigen::AngleAxisd(0.26 * any(random), Vector3d::UnitY()) *
           Eigen::AngleAxisd(0.17 * any(random), Vector3d::UnitX()))
              .toRotationMatrix();
      rig.cameras.push_back(std::move(camera));
    }
  }
  return rig;
}

Topology topology_of(const Rig& rig) {
  std::vector<int> all(rig.cameras.size());
  std::iota(all.begin(), all.end(), 0);
  return make_topology(rig, all);
}

/// The obvious way: a ray passes between three cameras if it is on one side of the planes to all
/// pairs, and one of them has it in its picture.
bool is_recorded(const Rig& rig, const Topology& topology, const Vector3d& from,
                 const Vector3d& direction) {
  for (const Topology::Cell& cell : topology.cells) {
    int positive = 0, negative = 0;
    for (std::size_t i = 0; i < 3; ++i) {
      const Vector3d a = rig.cameras[cell[i]].pose.position - from,
                     b = rig.cameras[cell[(i + 1) % 3]].pose.position - from;
      (direction.dot(a.cross(b)) < 0 ? negative : positive) += 1;
    }
    if (positive != 3 && negative != 3) continue;
    for (const int index : cell) {
      const Rig::Camera& camera = rig.cameras[index];
      const auto pixel =
          camera.model.project(camera.pose.world_from_camera_rotation.transpose() * direction);
      if (pixel && camera.model.contains(*pixel)) return true;
    }
  }
  return false;
}

/// Compares the share of directions within 30 degrees of one, from random positions.
void compare(const schemas::Distortion& distortion) {
  std::mt19937 random(20051);
  std::uniform_real_distribution<double> any(-1, 1);
  int partial = 0;
  for (int trial = 0; trial < 6; ++trial) {
    const Rig rig = real_rig(random, distortion);
    const Topology topology = topology_of(rig);
    const RecordedCells cells(rig, topology);
    const Vector3d from =
        Vector3d(0.02, -0.01, 0) + 0.08 * Vector3d(any(random), any(random), any(random));
    const double half = std::tan(30 * std::numbers::pi / 180);
    const std::vector<Vector3d> corners{
        {-half, -half, -1}, {half, -half, -1}, {half, half, -1}, {-half, half, -1}};
    double area = 0;
    for (const DirectionPolygon& part :
         cells.divide(from, {DirectionPolygon(corners)}).unrecorded) {
      area += part.picture_area(Eigen::Matrix3d::Identity());
    }
    const double share = 1 - area / (4 * half * half);
    constexpr int kSteps = 400, kHalf = kSteps / 2;
    int recorded = 0;
    for (int i = 0; i < kSteps * kSteps; ++i) {
      const int row = i / kSteps;
      const Vector2d at(half * ((i % kSteps + 0.5) / kHalf - 1), half * ((row + 0.5) / kHalf - 1));
      recorded += is_recorded(rig, topology, from, {at.x(), at.y(), -1}) ? 1 : 0;
    }
    EXPECT_NEAR(share, recorded / static_cast<double>(kSteps * kSteps), 1e-3) << trial;
    partial += share > 0.05 && share < 0.95 ? 1 : 0;
  }
  EXPECT_GE(partial, 3) << "the positions show little";
}

TEST(RecordedCells, OfPinholes) { compare({}); }
// The outlines of barrel-shaped pictures are not convex at the horizon.
TEST(RecordedCells, OfBarrelDistortion) { compare({-0.2, 0.04, 0, 0, 0}); }
TEST(RecordedCells, OfPincushionDistortion) { compare({0.15, 0, 0.002, -0.001, 0}); }
// The distortion folds back within the picture, whose corners see nothing.
TEST(RecordedCells, OfDistortionThatFolds) { compare({-0.45, 0, 0, 0, 0}); }

TEST(RecordedCells, RowsHaveNone) {
  std::mt19937 random(1);
  Rig row = real_rig(random, {});
  row.cameras.erase(row.cameras.begin() + 2, row.cameras.end());
  EXPECT_TRUE(RecordedCells(row, topology_of(row)).is_empty());
}

}  // namespace
}  // namespace raystage::rig::recorded_cells_test
