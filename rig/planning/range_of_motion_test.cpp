// SPDX-License-Identifier: Apache-2.0
#include "rig/planning/range_of_motion.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>

namespace raystage::rig {
namespace {

using ::testing::HasSubstr;

constexpr double kRadiansPerDegree = std::numbers::pi / 180;

/// An array of rows x columns cameras with a field of view, before a pose.
Rig grid(int rows, int columns, double spacing, double horizontal_fov, double vertical_fov,
         const Pose& pose = {}) {
  Rig rig;
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      schemas::CameraGeometry geometry;
      geometry.id = "c" + std::to_string(rig.cameras.size());
      geometry.width = 640;
      geometry.height = 480;
      geometry.intrinsics.fx = 320 / std::tan(horizontal_fov / 2);
      geometry.intrinsics.fy = 240 / std::tan(vertical_fov / 2);
      geometry.intrinsics.cx = 320;
      geometry.intrinsics.cy = 240;
      Pose of_camera = pose;
      of_camera.position = pose.world_from_camera(
          {spacing * (column - (columns - 1) / 2.0), spacing * (row - (rows - 1) / 2.0), 0});
      rig.cameras.push_back({geometry.id, CameraModel(geometry), of_camera, {}, row, column});
    }
  }
  return rig;
}

WallEyedArray ideal(const Rig& rig) {
  std::string reason;
  const auto array = find_wall_eyed_array(rig, {}, &reason);
  if (!array) throw std::runtime_error(reason);
  return *array;
}

Eigen::Matrix3d rotation(double pan, double tilt, double roll) {
  return (Eigen::AngleAxisd(pan, Eigen::Vector3d::UnitY()) *
          Eigen::AngleAxisd(tilt, Eigen::Vector3d::UnitX()) *
          Eigen::AngleAxisd(roll, Eigen::Vector3d::UnitZ()))
      .toRotationMatrix();
}

void expect_vertices(const ConvexPolyhedron& polyhedron,
                     const std::vector<Eigen::Vector3d>& expected, double tolerance) {
  ASSERT_EQ(polyhedron.vertices().size(), expected.size());
  for (const Eigen::Vector3d& point : expected) {
    double nearest = std::numeric_limits<double>::infinity();
    for (const Eigen::Vector3d& other : polyhedron.vertices()) {
      nearest = std::min(nearest, (other - point).norm());
    }
    EXPECT_LE(nearest, tolerance) << point.transpose();
  }
}

// Thesis figure 5-15: the array's corners, and in front and behind an edge along the longer side.
TEST(RangeOfMotion, OfARectangleIsTheClosedForm) {
  std::mt19937 random(2);  // NOLINT: the same in every run
  std::uniform_real_distribution<double> unit(0, 1);
  for (int repetition = 0; repetition < 100; ++repetition) {
    const int rows = 2 + repetition % 5, columns = 2 + repetition % 7;
    const double spacing = 0.01 + unit(random);
    const WallEyedArray array =
        ideal(grid(rows, columns, spacing, 120 * kRadiansPerDegree, 110 * kRadiansPerDegree));
    const double fov = (0.01 + 100 * unit(random)) * kRadiansPerDegree;
    const double vertical = (0.01 + 100 * unit(random)) * kRadiansPerDegree;
    const RangeOfMotion range =
        range_of_motion(array, {symmetric_slopes(fov, vertical), Eigen::Matrix3d::Identity()});
    const double x = spacing * (columns - 1) / 2, y = spacing * (rows - 1) / 2;
    const double tan_x = std::tan(fov / 2), tan_y = std::tan(vertical / 2);
    const double depth = std::min(x / tan_x, y / tan_y);
    std::vector<Eigen::Vector3d> expected{{x, y, 0}, {-x, y, 0}, {x, -y, 0}, {-x, -y, 0}};
    const double left_x = x - depth * tan_x, left_y = y - depth * tan_y;
    for (const double z : {-depth, depth}) {
      expected.emplace_back(left_x, left_y, z);
      expected.emplace_back(-left_x, -left_y, z);
    }
    expect_vertices(range.positions, expected, 1e-9);
    EXPECT_EQ(range.dimension, 3);
    EXPECT_EQ(range.empty_because, "");
  }
}

/// The definition: every extreme ray crosses the hull, with a slope that the cameras see.
double depth_reference(const WallEyedArray& array, const ViewFrustum& frustum,
                       const Eigen::Vector3d& position) {
  const Eigen::Matrix3d to_array =
      array.pose.world_from_camera_rotation.transpose() * frustum.world_from_camera_rotation;
  double depth = std::numeric_limits<double>::infinity();
  for (const double eye : {-0.5, 0.5}) {
    const Eigen::Vector3d from = position + to_array.col(0) * (eye * frustum.interaxial);
    for (const Eigen::Vector2d& corner : frustum.slopes.corners()) {
      const Eigen::Vector3d ray = to_array * Eigen::Vector3d(corner.x(), corner.y(), -1);
      const Eigen::Vector2d crossing = (from - ray * (from.z() / ray.z())).head<2>();
      for (std::size_t i = 0; i < array.hull.size(); ++i) {
        const Eigen::Vector2d side = array.hull[(i + 1) % array.hull.size()] - array.hull[i];
        const Eigen::Vector2d outward = Eigen::Vector2d(side.y(), -side.x()).normalized();
        depth = std::min(depth, -outward.dot(crossing - array.hull[i]));
      }
    }
  }
  return depth;
}

TEST(RangeOfMotion, HoldsExactlyThePositionsWhoseRaysWereRecorded) {
  std::mt19937 random(3);  // NOLINT: the same in every run
  std::uniform_real_distribution<double> unit(-1, 1);
  int inside = 0, outside = 0;
  for (int repetition = 0; repetition < 60; ++repetition) {
    Pose pose{rotation(unit(random), unit(random), unit(random)), {3, -2, 5}};
    Rig rig = grid(4, 5, 0.06, 100 * kRadiansPerDegree, 90 * kRadiansPerDegree, pose);
    // A hull of any number of corners.
    if (repetition % 2 == 0) rig.cameras.erase(rig.cameras.begin());
    const WallEyedArray array = ideal(rig);
    const ViewFrustum frustum{symmetric_slopes(40 * kRadiansPerDegree, 30 * kRadiansPerDegree),
                              pose.world_from_camera_rotation *
                                  rotation(0.35 * unit(random), 0.3 * unit(random), unit(random)),
                              repetition % 3 == 0 ? 0.02 : 0.0};
    const RangeOfMotion range = range_of_motion(array, frustum);
    ASSERT_EQ(range.empty_because, "");
    for (int i = 0; i < 500; ++i) {
      const Eigen::Vector3d position(0.2 * unit(random), 0.2 * unit(random), 0.4 * unit(random));
      const double expected = depth_reference(array, frustum, position);
      if (std::abs(expected) < 1e-12) continue;
      const bool is_inside = range.positions.signed_distance(position) > 0;
      EXPECT_EQ(is_inside, expected > 0) << position.transpose();
      ++(is_inside ? inside : outside);
    }
  }
  EXPECT_GT(inside, 1000);
  EXPECT_GT(outside, 1000);
}

// Thesis 5.2.2: |th| + a <= A, at the limit and beyond.
TEST(RangeOfMotion, EndsWhereTheViewSeesMoreThanTheCameras) {
  const WallEyedArray array =
      ideal(grid(8, 8, 0.06, 75 * kRadiansPerDegree, 75 * kRadiansPerDegree));
  const auto range = [&](double fov, double pan) {
    return range_of_motion(array, {symmetric_slopes(fov * kRadiansPerDegree, 1 * kRadiansPerDegree),
                                   rotation(pan * kRadiansPerDegree, 0, 0)});
  };
  EXPECT_EQ(range(75, 0).empty_because, "");
  EXPECT_THAT(range(75.01, 0).empty_because, HasSubstr("which no camera sees"));
  EXPECT_EQ(range(45, 15).empty_because, "");  // 45 + 2 * 15 = 75 (eq. 6.1)
  EXPECT_EQ(range(45, -15).empty_because, "");
  EXPECT_THAT(range(45, 15.01).empty_because, HasSubstr("which no camera sees"));
  EXPECT_THAT(range(45, 120).empty_because, HasSubstr("looks past"));
  EXPECT_TRUE(range(45, 120).positions.is_empty());
}

TEST(RangeOfMotion, OfAStereoCameraIsTheIntersectionOfBothEyes) {
  const WallEyedArray array =
      ideal(grid(8, 8, 0.06, 62 * kRadiansPerDegree, 50 * kRadiansPerDegree));
  ViewFrustum frustum{symmetric_slopes(40 * kRadiansPerDegree, 30 * kRadiansPerDegree),
                      Eigen::Matrix3d::Identity()};
  frustum.interaxial = 0.065;
  double widest = 0;
  const RangeOfMotion range = range_of_motion(array, frustum);
  for (const Eigen::Vector3d& vertex : range.positions.vertices()) {
    widest = std::max(widest, vertex.x());
  }
  EXPECT_NEAR(widest, 0.21 - 0.0325, 1e-12);
  frustum.interaxial = 0.43;
  EXPECT_THAT(range_of_motion(array, frustum).empty_because, HasSubstr("which the array cannot"));
}

TEST(RangeOfMotion, OfARowIsFlatAndOfOneCentreAPoint) {
  const WallEyedArray row = ideal(grid(1, 9, 0.1, 90 * kRadiansPerDegree, 60 * kRadiansPerDegree));
  const RangeOfMotion flat =
      range_of_motion(row, {symmetric_slopes(60 * kRadiansPerDegree, 1 * kRadiansPerDegree),
                            Eigen::Matrix3d::Identity()});
  EXPECT_EQ(flat.dimension, 2);
  const double depth = 0.4 / std::tan(30 * kRadiansPerDegree);
  expect_vertices(flat.positions, {{0.4, 0, 0}, {-0.4, 0, 0}, {0, 0, depth}, {0, 0, -depth}}, 1e-9);
  // Distances are those within its plane, and outside of it those in space.
  const auto distance = [&](double x, double y, double z) {
    return flat.positions.signed_distance({x, y, z});
  };
  EXPECT_NEAR(distance(0, 0, 0), 0.4 * std::cos(30 * kRadiansPerDegree), 1e-9);
  EXPECT_NEAR(distance(0.5, 0, 0), -0.1, 1e-9);
  EXPECT_NEAR(distance(0, 0.3, 0), -0.3, 1e-9);
  EXPECT_LT((flat.positions.nearest_point({0.5, 0, 0}) - Eigen::Vector3d(0.4, 0, 0)).norm(), 1e-9);
  EXPECT_LT((flat.positions.nearest_point({0.1, 0, 0.1}) - Eigen::Vector3d(0.1, 0, 0.1)).norm(),
            1e-9);
  // Rounding does not give it a width.
  const Pose turned{rotation(0.4, 0.3, 0.2), {1, 2, 3}};
  for (const double offset : {0.0, 1e3, 1e7}) {
    const Pose far_away{turned.world_from_camera_rotation, turned.position * (1 + offset)};
    EXPECT_EQ(ideal(grid(1, 9, 0.1, 1, 1, far_away)).hull.size(), 2U) << offset;
  }
  ViewFrustum stereo{symmetric_slopes(0.5, 0.01), Eigen::Matrix3d::Identity(), 0.065};
  EXPECT_EQ(range_of_motion(row, stereo).empty_because, "");
  stereo.world_from_camera_rotation = rotation(0, 0, std::numbers::pi / 2);
  stereo.slopes = symmetric_slopes(0.01, 0.5);
  EXPECT_THAT(range_of_motion(row, stereo).empty_because, HasSubstr("not in the plane of the row"));
  for (const Rig& rig : {grid(1, 1, 0.1, 1, 1), grid(1, 4, 0, 1, 1)}) {
    const RangeOfMotion point =
        range_of_motion(ideal(rig), {symmetric_slopes(0.5, 0.5), Eigen::Matrix3d::Identity()});
    EXPECT_EQ(point.dimension, 0);
    EXPECT_EQ(point.empty_because, "");
    EXPECT_THAT(
        range_of_motion(ideal(rig), {symmetric_slopes(0.5, 0.5), Eigen::Matrix3d::Identity(), 0.06})
            .empty_because,
        HasSubstr("two eyes"));
  }
}

TEST(RangeOfMotion, AroundASubjectNeedsOnlyTheRaysThatMeetIt) {
  const WallEyedArray array =
      ideal(grid(6, 8, 0.1, 70 * kRadiansPerDegree, 55 * kRadiansPerDegree));
  std::vector<Eigen::Vector3d> subject;
  for (int corner = 0; corner < 8; ++corner) {
    subject.emplace_back((corner & 1) != 0 ? 0.3 : -0.2, (corner & 2) != 0 ? 0.2 : -0.3,
                         (corner & 4) != 0 ? -2.0 : -2.5);
  }
  const RangeOfMotion range = range_of_motion_around(array, subject, 3);
  ASSERT_EQ(range.empty_because, "");
  std::mt19937 random(4);  // NOLINT: the same in every run
  std::uniform_real_distribution<double> unit(-1, 1);
  int inside = 0;
  for (int i = 0; i < 20000; ++i) {
    const Eigen::Vector3d p(unit(random), unit(random), -1.9 + 2.4 * (1 + unit(random)));
    double depth = 3 - p.z();
    for (const Eigen::Vector3d& q : subject) {
      const Eigen::Vector3d ray = q - p;
      depth = std::min(depth, -ray.z());
      const Eigen::Vector2d crossing = (p - ray * (p.z() / ray.z())).head<2>();
      depth = std::min({depth, 0.35 - std::abs(crossing.x()), 0.25 - std::abs(crossing.y())});
      const Eigen::Vector2d slope = ray.head<2>() / -ray.z();
      depth = std::min({depth, array.slopes.largest.x() - std::abs(slope.x()),
                        array.slopes.largest.y() - std::abs(slope.y())});
    }
    if (std::abs(depth) < 1e-9) continue;
    EXPECT_EQ(range.positions.signed_distance(p) > 0, depth > 0) << p.transpose();
    inside += depth > 0 ? 1 : 0;
  }
  EXPECT_GT(inside, 500);
  EXPECT_THAT(range_of_motion_around(array, {}, 3).empty_because, HasSubstr("no subject"));
  EXPECT_THAT(
      range_of_motion_around(array, std::vector<Eigen::Vector3d>{{0, 0, 1}}, 3).empty_because,
      HasSubstr("not in front"));
}

TEST(RangeOfMotion, IsExactForNarrowAndWideViewsFarFromTheOrigin) {
  for (const double offset : {0.0, 1e3, 1e7}) {
    const Pose pose{rotation(0.3, -0.2, 0.1), {offset, -offset, offset}};
    std::string reason;
    const auto array = find_wall_eyed_array(
        grid(8, 8, 0.06, 179.5 * kRadiansPerDegree, 179.5 * kRadiansPerDegree, pose), {}, &reason);
    ASSERT_TRUE(array) << reason;
    for (const double fov : {0.01, 1.0, 90.0, 179.0}) {
      const RangeOfMotion range = range_of_motion(
          *array, {symmetric_slopes(fov * kRadiansPerDegree, fov * kRadiansPerDegree),
                   pose.world_from_camera_rotation});
      const double half = array->size().x() / 2,
                   depth = half / std::tan(fov * kRadiansPerDegree / 2);
      double farthest = 0;
      for (const Eigen::Vector3d& vertex : range.positions.vertices()) {
        farthest = std::max(farthest, vertex.z());
      }
      // Centres far from the world's origin are rounded, which narrow views magnify.
      const double rounding = 1e-15 * offset / std::tan(fov * kRadiansPerDegree / 2);
      EXPECT_NEAR(farthest, depth, 1e-12 * std::max(1.0, depth) + rounding) << offset << " " << fov;
    }
  }
}

TEST(WallEyedArray, SaysWhyARigIsNone) {
  const auto reason_of = [](const Rig& rig) {
    std::string reason;
    EXPECT_FALSE(find_wall_eyed_array(rig, {}, &reason));
    return reason;
  };
  Rig rig = grid(2, 2, 0.1, 1, 1);
  rig.cameras[2].pose.world_from_camera_rotation = rotation(1e-4, 0, 0);
  EXPECT_EQ(reason_of(rig), "cameras c0 and c2 are not parallel");
  rig = grid(2, 2, 0.1, 1, 1);
  rig.cameras[3].pose.position.z() += 0.001;
  EXPECT_EQ(reason_of(rig), "the cameras' centres are up to 0.001 m in front of each other");
  rig = grid(2, 2, 0.1, 1, 1);
  rig.cameras[1].model = grid(1, 1, 0, 1.1, 1).cameras[0].model;
  EXPECT_EQ(reason_of(rig), "cameras c0 and c1 have different fields of view");
  schemas::CameraGeometry distorted;
  distorted.width = 640;
  distorted.height = 480;
  distorted.intrinsics = {500, 500, 320, 240, {.k1 = 0.01}};
  rig.cameras[1].model = CameraModel(distorted);
  EXPECT_EQ(reason_of(rig), "camera c1 has lens distortion");
  EXPECT_EQ(reason_of(Rig()), "it has no cameras");
}

}  // namespace
}  // namespace raystage::rig
