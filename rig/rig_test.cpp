// SPDX-License-Identifier: Apache-2.0
#include "rig/rig.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <limits>
#include <numbers>

#include "base/error.h"
#include "rig/row_times.h"

namespace raystage::rig::rig_test {
namespace {

schemas::RigDocument document_of_grid(int rows, int columns) {
  schemas::RigDocument document;
  document.name = "test";
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      schemas::RigDocument::Camera camera;
      camera.geometry.id = std::to_string(row) + "_" + std::to_string(column);
      camera.geometry.width = 320;
      camera.geometry.height = 240;
      camera.geometry.intrinsics = {300, 300, 160, 120, {}};
      camera.geometry.world_from_camera[3] = 0.1 * column;
      camera.geometry.world_from_camera[7] = -0.1 * row;
      camera.geometry.row = row;
      camera.geometry.column = column;
      document.cameras.push_back(camera);
    }
  }
  return document;
}

TEST(Pose, MatrixRoundTrip) {
  Pose pose;
  pose.world_from_camera_rotation =
      Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, 2, 3).normalized()).toRotationMatrix();
  pose.position = {1, -2, 3};
  const Pose back = pose_from_matrix(matrix_from_pose(pose));
  EXPECT_EQ(back.world_from_camera_rotation, pose.world_from_camera_rotation);
  EXPECT_EQ(back.position, pose.position);
  const Eigen::Vector3d x(0.3, 0.2, -4);
  EXPECT_NEAR((pose.camera_from_world(pose.world_from_camera(x)) - x).norm(), 0, 1e-14);
  EXPECT_EQ(Pose{}.viewing_direction(), Eigen::Vector3d(0, 0, -1));
}

TEST(Rig, CentreAndDirection) {
  const Rig rig = rig_from_document(document_of_grid(3, 3));
  EXPECT_NEAR((rig.centre() - Eigen::Vector3d(0.1, -0.1, 0)).norm(), 0, 1e-15);
  EXPECT_EQ(rig.mean_viewing_direction(), Eigen::Vector3d(0, 0, -1));
}

/// Two f-theta lenses whose pictures show their circle, except beyond `outer_px` from the principal
/// point towards the side to which the camera is turned, off the mean direction.
Rig turned_apart(double half_angle_deg, double turn_deg, double outer_px) {
  constexpr double kDegree = std::numbers::pi / 180;
  schemas::RigDocument document;
  for (const double side : {-1.0, 1.0}) {
    schemas::CameraGeometry camera;
    camera.id = side < 0 ? "left" : "right";
    camera.width = camera.height = 1200;
    camera.intrinsics = {400, 400, side < 0 ? outer_px : 1200 - outer_px, 600, {}};
    camera.intrinsics.projection = schemas::Projection::kFtheta;
    camera.intrinsics.half_angle = half_angle_deg * kDegree;
    Pose pose;
    pose.position = {0.05 * side, 0, 0};
    pose.world_from_camera_rotation =
        Eigen::AngleAxisd(-side * turn_deg * kDegree, Eigen::Vector3d::UnitY()).toRotationMatrix();
    camera.world_from_camera = matrix_from_pose(pose);
    document.cameras.push_back({camera, {}});
  }
  return rig_from_document(document);
}

// More than 75 degrees off the mean direction.
TEST(Rig, LooksAroundByTheCirclesOfTurnedFisheyes) {
  constexpr double kWhole = 600;
  EXPECT_FALSE(turned_apart(70, 0, kWhole).looks_around());
  EXPECT_FALSE(turned_apart(70, 4, kWhole).looks_around());
  EXPECT_TRUE(turned_apart(70, 6, kWhole).looks_around());
  EXPECT_TRUE(turned_apart(70, 10, kWhole).looks_around());
  // Of the side that is turned outwards they record 20 degrees.
  EXPECT_FALSE(turned_apart(70, 10, 140).looks_around());
}

TEST(Rig, RefusesUnusableDocuments) {
  EXPECT_THROW(rig_from_document(schemas::RigDocument{}), Error);
  schemas::RigDocument document = document_of_grid(2, 2);
  document.cameras[1].geometry.intrinsics.fx = -1;
  EXPECT_THROW(rig_from_document(document), Error);
  document = document_of_grid(2, 2);
  document.topology = "grid";
  document.cameras[3].geometry.row.reset();
  EXPECT_THROW(rig_from_document(document), Error);
}

TEST(Rig, TopologyOfSomeCamerasIndexesTheRig) {
  schemas::RigDocument document = document_of_grid(3, 3);
  const std::vector<int> without_first{1, 2, 3, 4, 5, 6, 7, 8};
  for (const char* kind : {"auto", "grid", "delaunay"}) {
    document.topology = kind;
    const Topology topology = make_topology(rig_from_document(document), without_first);
    EXPECT_EQ(topology.cells.size(), 7U) << kind;
    for (const auto& cell : topology.cells) {
      for (const int corner : cell) EXPECT_TRUE(corner >= 1 && corner <= 8);
    }
  }
  const std::vector<int> one{5};
  EXPECT_EQ(make_topology(rig_from_document(document), one).cells.at(0),
            (Topology::Cell{5, -1, -1}));
}

TEST(Rig, AutoTakesDelaunayWithoutPlaces) {
  schemas::RigDocument document = document_of_grid(3, 3);
  document.cameras[4].geometry.column.reset();
  const std::vector<int> all{0, 1, 2, 3, 4, 5, 6, 7, 8};
  EXPECT_EQ(make_topology(rig_from_document(document), all).cells.size(), 8U);
}

TEST(Rig, PlaneInFront) {
  schemas::RigDocument document = document_of_grid(3, 3);
  const Rig rig = rig_from_document(document);
  const Eigen::Vector4d plane = fronto_parallel_plane(rig, 8);
  EXPECT_NEAR(plane.head<3>().norm(), 1, 1e-15);
  EXPECT_NEAR(plane.dot(Eigen::Vector4d(5, 7, -8, 1)), 0, 1e-12);
  EXPECT_EQ(fronto_parallel_plane(rig, std::numeric_limits<double>::infinity()),
            Eigen::Vector4d(0, 0, 0, 1));
}

TEST(Rig, BestFocalDepth) {
  EXPECT_DOUBLE_EQ(optimal_focal_depth({2, 6}), 3);
  EXPECT_DOUBLE_EQ(optimal_focal_depth({4, std::numeric_limits<double>::infinity()}), 8);
  EXPECT_DOUBLE_EQ(optimal_focal_depth({5, 5}), 5);
  EXPECT_THROW(optimal_focal_depth({0, 5}), Error);
  EXPECT_THROW(optimal_focal_depth({5, 4}), Error);
  EXPECT_THROW(optimal_focal_depth({std::nan(""), 4}), Error);
}

TEST(Rig, BestFocalDepthAtTheEndsOfDoubles) {
  constexpr double kMin = std::numeric_limits<double>::denorm_min();
  constexpr double kMax = std::numeric_limits<double>::max();
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  for (const double depth : {kMin, 1e-310, 1e-3, 0.1, 1.7, 1e9, kMax}) {
    EXPECT_EQ(optimal_focal_depth({depth, depth}), depth);  // near = far: no other depth
  }
  EXPECT_EQ(optimal_focal_depth({kMin, kInfinity}), 2 * kMin);
  EXPECT_EQ(optimal_focal_depth({1.5, kInfinity}), 3);  // eq. 2.2
  EXPECT_DOUBLE_EQ(optimal_focal_depth({1, 3}), 1.5);
  EXPECT_DOUBLE_EQ(optimal_focal_depth({1e-3, 1e9}), 2 / (1e3 + 1e-9));
}

/// Returns the rig moved in the world.
Rig moved(Rig rig, const Eigen::Vector3d& by) {
  for (Rig::Camera& camera : rig.cameras) camera.pose.position += by;
  return rig;
}

TEST(Rig, RowTimesCountFromTheMiddleOfThePicture) {
  schemas::RigDocument document;
  schemas::CameraGeometry camera;
  camera.id = "a";
  camera.width = camera.height = 8;
  camera.line_time_us = -12.5;
  document.cameras.push_back({camera, {}});
  const double line_time_us = rig_from_document(document).cameras[0].line_time_us;
  EXPECT_EQ(line_time_us, -12.5);
  EXPECT_EQ(row_time_ns(line_time_us, 8, 4), 0);
  EXPECT_EQ(row_time_ns(line_time_us, 8, 0.5), 43'750) << "from the bottom up: the top row is last";
  EXPECT_EQ(row_time_ns(line_time_us, 8, 7.5), -43'750);
  EXPECT_EQ(row_time_ns(0, 8, 7.5), 0);
  EXPECT_DOUBLE_EQ(read_out_ms(line_time_us, 8), 0.1);
}

TEST(Rig, FarFromTheWorldsOriginItIsTheSame) {
  for (const auto& [rows, columns] : {std::pair{4, 4}, {1, 5}, {1, 1}}) {
    schemas::RigDocument document;
    std::vector<int> all;
    for (int i = 0; i < rows * columns; ++i) {
      schemas::CameraGeometry camera;
      camera.id = std::to_string(i);
      camera.width = camera.height = 8;
      // 1/16 m is a multiple of the resolution of doubles at 1e7 m: the moved rig is exact.
      const int row = i / columns, column = i % columns;
      camera.world_from_camera[3] = column / 16.0;
      camera.world_from_camera[7] = row / 16.0;
      document.cameras.push_back({camera, {}});
      all.push_back(i);
    }
    const Rig near = rig_from_document(document);
    const Eigen::Vector3d far_off(1e7, -1e7, 3e6);
    const Rig far = moved(near, far_off);
    const Topology near_cells = make_topology(near, all), far_cells = make_topology(far, all);
    EXPECT_EQ(near_cells.kind, far_cells.kind);
    EXPECT_EQ(near_cells.cells, far_cells.cells);
    EXPECT_EQ(near_cells.normal, far_cells.normal);
    EXPECT_EQ(near_cells.up, far_cells.up);
    EXPECT_EQ(far.centre() - far_off, near.centre());
    const Eigen::Vector4d plane = fronto_parallel_plane(far, 4);
    EXPECT_NEAR(plane.head<3>().dot(far.centre()) + plane.w(), -4, 4e-9);
  }
}

}  // namespace
}  // namespace raystage::rig::rig_test
