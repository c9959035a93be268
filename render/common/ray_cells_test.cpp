// SPDX-License-Identifier: Apache-2.0
#include "render/common/ray_cells.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>
#include <random>

#include "testing/render/synthetic_take.h"

namespace raystage::render::ray_cells_test {
namespace {

rig::Rig grid_rig(int rows, int columns, double spacing) {
  schemas::RigDocument document;
  for (const auto& camera : testing::camera_grid(rows, columns, spacing, 64, 48)) {
    document.cameras.push_back({camera, {}});
  }
  return rig::rig_from_document(document);
}

std::vector<int> all_cameras(const rig::Rig& rig) {
  std::vector<int> cameras;
  for (int i = 0; i < static_cast<int>(rig.cameras.size()); ++i) cameras.push_back(i);
  return cameras;
}

VirtualCamera view_at(const Eigen::Vector3d& position, double yaw = 0) {
  rig::Pose pose;
  pose.position = position;
  pose.world_from_camera_rotation =
      Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitY()).toRotationMatrix();
  return virtual_camera_with_fov(64, 48, 50 * std::numbers::pi / 180, pose);
}

/// Returns the barycentric coordinates of the point where the ray (a whole line) meets the
/// triangle's plane.
std::array<double, 3> by_intersection(const rig::Rig& rig, const RayCells::Cell& cell,
                                      const Eigen::Vector3d& eye, const Eigen::Vector3d& ray) {
  std::array<Eigen::Vector3d, 3> c;
  for (std::size_t i = 0; i < 3; ++i) {
    c[i] = rig.cameras[cell.camera[i]].pose.position;
  }
  const Eigen::Vector3d normal = (c[1] - c[0]).cross(c[2] - c[0]);
  const Eigen::Vector3d hit = eye + ray * (normal.dot(c[0] - eye) / normal.dot(ray));
  std::array<double, 3> weight{};
  for (std::size_t i = 0; i < 3; ++i) {
    const Eigen::Vector3d &b = c[(i + 1) % 3], &d = c[(i + 2) % 3];
    weight[i] = (b - hit).cross(d - hit).dot(normal) / normal.squaredNorm();
  }
  return weight;
}

TEST(RayCells, WeightsAreBarycentricCoordinatesOfTheCrossing) {
  rig::Rig rig = grid_rig(4, 4, 0.06);
  std::mt19937 random(3);
  std::normal_distribution<double> error(0, 0.003);
  for (auto& camera : rig.cameras) {
    for (int axis = 0; axis < 3; ++axis) camera.pose.position[axis] += error(random);
  }
  const rig::Topology topology = rig::make_topology(rig, all_cameras(rig));
  for (const double z : {0.5, 0.1, -0.4}) {  // behind the array, near, in front of it
    const VirtualCamera view = view_at({0.01, -0.02, z}, 0.1);
    const RayCells cells(view, rig, topology);
    const Eigen::Matrix3d ray_from_pixel = world_ray_from_pixel(view);
    int crossed = 0;
    for (int y = 0; y < view.height; ++y) {
      for (int x = 0; x < view.width; ++x) {
        const auto crossing = cells.locate(x + 0.5, y + 0.5);
        if (!crossing) continue;
        ++crossed;
        const auto expected =
            by_intersection(rig, cells.cells()[crossing->cell], view.pose.position,
                            ray_from_pixel * Eigen::Vector3d(x + 0.5, y + 0.5, 1));
        for (std::size_t i = 0; i < 3; ++i) {
          EXPECT_NEAR(crossing->weight[i], expected[i], 1e-8) << x << " " << y << " z " << z;
        }
      }
    }
    EXPECT_GT(crossed, 100);
  }
}

TEST(RayCells, NearestIsTheCameraNearestToTheCrossing) {
  for (const auto& [rows, columns] : {std::pair{4, 5}, {1, 4}, {1, 1}}) {
    const rig::Rig rig = grid_rig(rows, columns, 0.06);
    const VirtualCamera view = view_at({0.013, -0.021, 0.12}, 0.1);
    const RayCells cells(view, rig, rig::make_topology(rig, all_cameras(rig)));
    const Eigen::Matrix3d ray_from_pixel = world_ray_from_pixel(view);
    int crossed = 0;
    for (int y = 0; y < view.height; ++y) {
      for (int x = 0; x < view.width; ++x) {
        const auto crossing = cells.locate(x + 0.5, y + 0.5);
        if (!crossing) continue;
        ++crossed;
        const Eigen::Vector3d ray = ray_from_pixel * Eigen::Vector3d(x + 0.5, y + 0.5, 1);
        const Eigen::Vector3d hit = view.pose.position - ray * (view.pose.position.z() / ray.z());
        const auto distance = [&, &rows = rows](int camera) {
          const Eigen::Vector3d& at = rig.cameras[camera].pose.position;
          return rows > 1 ? (at - hit).norm() : std::abs(at.x() - hit.x());
        };
        int brute = 0;
        for (const int camera : all_cameras(rig)) {
          if (distance(camera) < distance(brute)) brute = camera;
        }
        const auto nearest = cells.nearest(*crossing);
        const auto& cell = cells.cells()[crossing->cell];
        for (std::size_t i = 0; i < static_cast<std::size_t>(cell.count); ++i) {
          if (nearest.weight[i] == 0) continue;
          EXPECT_EQ(nearest.weight[i], 1);
          EXPECT_NEAR(distance(cell.camera[i]), distance(brute), 1e-9) << x << " " << y;
        }
      }
    }
    EXPECT_GT(crossed, 100);
  }
}

TEST(RayCells, SpansAgreeWithEveryPixelsOwnCrossing) {
  const rig::Rig rig = grid_rig(5, 3, 0.06);
  const rig::Topology topology = rig::make_topology(rig, all_cameras(rig));
  for (const Eigen::Vector3d& eye :
       {Eigen::Vector3d(0, 0, 0.4), Eigen::Vector3d(0, 0, 0), Eigen::Vector3d(0.06, 0.12, 0),
        Eigen::Vector3d(0.01, 0, -0.3), Eigen::Vector3d(3, 0, 0), Eigen::Vector3d(0, 0, 1e6)}) {
    for (const double yaw : {0.0, 0.4, std::numbers::pi / 2}) {
      const VirtualCamera view = view_at(eye, yaw);
      const RayCells cells(view, rig, topology);
      std::vector<int> scratch;
      std::vector<RayCells::Span> spans;
      for (int y = 0; y < view.height; ++y) {
        cells.row_spans(y, view.width, scratch, spans);
        std::vector<int> by_span(static_cast<std::size_t>(view.width), -1);
        for (const auto& span : spans) {
          for (int x = span.begin; x < span.end; ++x) {
            by_span[x] = span.cell;
          }
        }
        for (int x = 0; x < view.width; ++x) {
          const auto crossing = cells.locate(x + 0.5, y + 0.5);
          EXPECT_EQ(by_span[x], crossing ? crossing->cell : -1)
              << "pixel " << x << ", " << y << " eye " << eye.transpose() << " yaw " << yaw;
        }
      }
    }
  }
}

TEST(RayCells, AtACamerasOwnCentreOnlyThatCameraCounts) {
  const rig::Rig rig = grid_rig(3, 3, 0.06);
  const RayCells cells(view_at(rig.cameras[4].pose.position), rig,
                       rig::make_topology(rig, all_cameras(rig)));
  for (const double x : {0.5, 20.0, 63.5}) {
    const auto crossing = cells.locate(x, 10.5);
    ASSERT_TRUE(crossing);
    const auto& cell = cells.cells()[crossing->cell];
    for (std::size_t i = 0; i < 3; ++i) {
      EXPECT_NEAR(crossing->weight[i], cell.camera[i] == 4 ? 1 : 0, 1e-12);
    }
  }
}

TEST(RayCells, InTheMiddleOfAnEdgeTheThirdCameraHasNoShare) {
  const rig::Rig rig = grid_rig(2, 2, 0.1);
  rig::Pose pose;
  for (const double off : {0.0, 1e-13}) {
    pose.position = {off, -off / 3, 0};  // on the diagonal, whichever way it is split
    const VirtualCamera view = virtual_camera_with_fov(96, 64, 1, pose);
    const RayCells cells(view, rig, rig::make_topology(rig, all_cameras(rig)));
    for (const RayCells::Cell& cell : cells.cells()) {
      int none = 0;
      for (const auto& share : cell.share) none += share.isZero(0) ? 1 : 0;
      EXPECT_EQ(none, 1);
    }
    const auto crossing = cells.locate(20, 30);
    ASSERT_TRUE(crossing);
    EXPECT_NEAR(crossing->weight[0] + crossing->weight[1] + crossing->weight[2], 1, 1e-9);
    EXPECT_EQ(std::ranges::count(crossing->weight, 0), 1);
  }
}

TEST(RayCells, OutsideTheArraysPlaneNothingIsCrossed) {
  const rig::Rig rig = grid_rig(3, 3, 0.06);
  const RayCells cells(view_at({0.2, 0, 0}), rig, rig::make_topology(rig, all_cameras(rig)));
  EXPECT_FALSE(cells.locate(32, 24));
}

TEST(RayCells, ALineOfCamerasIsAStripAndOneCameraIsEverywhere) {
  const rig::Rig line = grid_rig(1, 4, 0.06);
  const RayCells strip(view_at({0.03, 0.5, 0}), line, rig::make_topology(line, all_cameras(line)));
  const auto crossing = strip.locate(32, 24);
  ASSERT_TRUE(crossing);
  const auto& cell = strip.cells()[crossing->cell];
  EXPECT_EQ(cell.count, 2);
  for (std::size_t i = 0; i < 2; ++i) {
    const double x = line.cameras[cell.camera[i]].pose.position.x();
    EXPECT_NEAR(crossing->weight[i], 1 - std::abs(x - 0.03) / 0.06, 1e-9);
  }
  const rig::Rig one = grid_rig(1, 1, 0.06);
  const RayCells point(view_at({5, 5, 5}), one, rig::make_topology(one, all_cameras(one)));
  ASSERT_TRUE(point.locate(1, 1));
  EXPECT_EQ(point.locate(1, 1)->weight[0], 1);
}

}  // namespace
}  // namespace raystage::render::ray_cells_test
