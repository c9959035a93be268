// SPDX-License-Identifier: Apache-2.0
#include "rig/planning/array_design.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <random>

#include "rig/planning/range_of_motion.h"

namespace raystage::rig {
namespace {

constexpr double kOneDegree = std::numbers::pi / 180;
constexpr double kInfinite = std::numeric_limits<double>::infinity();

PlannedView view_at(double x, double y, double z, double max_yaw_deg = 0) {
  return {{x, y, z}, {-max_yaw_deg * kOneDegree, max_yaw_deg * kOneDegree}, {0, 0}};
}

// Thesis eq. 6.1: views of 45 degrees that turn by 15 need 75, not the 60 of its text.
TEST(ArrayRequirements, FieldOfViewIsThatOfTheViewsAndTwiceTheirRotation) {
  const std::vector<PlannedView> views{view_at(0, 0, 0, 15)};
  const auto needed = array_requirements(views, {45 * kOneDegree, 1e9, 0});  // one row of pixels
  ASSERT_TRUE(needed);
  EXPECT_NEAR(needed->horizontal_fov, 75 * kOneDegree, 1e-12);
  EXPECT_FALSE(array_requirements(std::vector{view_at(0, 0, 0, 80)}, {45 * kOneDegree, 1, 0}));
}

TEST(ArrayRequirements, ExtentIsWhereTheExtremeRaysCrossTheArray) {
  const double half_width = std::tan(22.5 * kOneDegree);
  const std::vector<PlannedView> views{view_at(-0.5, 0, 1), view_at(0.25, 0.1, -2)};
  const auto needed = array_requirements(views, {45 * kOneDegree, 2, 0.1});
  ASSERT_TRUE(needed);
  EXPECT_NEAR(needed->extent.min().x(), std::min(-0.5 - half_width, 0.25 - 2 * half_width) - 0.05,
              1e-12);
  EXPECT_NEAR(needed->extent.max().x(), 0.25 + 2 * half_width + 0.05, 1e-12);
  EXPECT_NEAR(needed->extent.max().y(), 0.1 + half_width, 1e-12);
  EXPECT_NEAR(needed->vertical_fov, 2 * std::atan(half_width / 2), 1e-12);
}

// The array that is designed has all views in its range of motion, and none is smaller.
TEST(ArrayRequirements, ContainTheViewsTightly) {
  std::mt19937 random(7);
  const auto uniform = [&](double low, double high) {
    return std::uniform_real_distribution<>(low, high)(random);
  };
  for (int round = 0; round < 50; ++round) {
    PlannedPicture picture{uniform(20, 60) * kOneDegree, uniform(0.6, 2), 0};
    std::vector<PlannedView> views;
    for (int i = 0; i < 4; ++i) {
      PlannedView view = view_at(uniform(-1, 1), uniform(-1, 1), uniform(-2, 2));
      view.yaw.first = view.yaw.second = uniform(-20, 20) * kOneDegree;
      view.pitch.first = view.pitch.second = uniform(-10, 10) * kOneDegree;
      views.push_back(view);
    }
    const auto needed = array_requirements(views, picture);
    ASSERT_TRUE(needed);
    const auto distance_in = [&](double growth) {
      WallEyedArray array;
      const Eigen::Vector2d middle = needed->extent.center();
      const Eigen::Vector2d half = (needed->extent.sizes() / 2).array() + growth;
      array.hull = {middle - half, middle + Eigen::Vector2d(half.x(), -half.y()), middle + half,
                    middle + Eigen::Vector2d(-half.x(), half.y())};
      array.slopes = symmetric_slopes(needed->horizontal_fov, needed->vertical_fov);
      double least = kInfinite;
      for (const PlannedView& view : views) {
        ViewFrustum frustum;
        frustum.slopes =
            symmetric_slopes(picture.horizontal_fov,
                             2 * std::atan(std::tan(picture.horizontal_fov / 2) / picture.aspect));
        frustum.world_from_camera_rotation =
            (Eigen::AngleAxisd(view.yaw.first, Eigen::Vector3d::UnitY()) *
             Eigen::AngleAxisd(view.pitch.first, Eigen::Vector3d::UnitX()))
                .toRotationMatrix();
        const RangeOfMotion range = range_of_motion(array, frustum);
        least = std::min(least, range.positions.signed_distance(view.position));
      }
      return least;
    };
    EXPECT_GE(distance_in(0), -1e-9);
    EXPECT_LT(distance_in(-1e-6), 0);
  }
}

// Views that turn in both directions, also to one side only: no ray of any orientation crosses the
// array's plane outside of the extent, and the extent is where some do.
TEST(ArrayRequirements, ContainEveryOrientation) {
  std::mt19937 random(8);
  const auto uniform = [&](double low, double high) {
    return std::uniform_real_distribution<>(low, high)(random);
  };
  for (int round = 0; round < 40; ++round) {
    const PlannedPicture picture{uniform(10, 40) * kOneDegree, uniform(0.6, 2), 0};
    PlannedView view = view_at(0, 0, uniform(0.2, 2) * (round % 2 == 0 ? 1 : -1));
    const double least_yaw = uniform(-40, 20), least_pitch = uniform(-30, 20);
    view.yaw = {least_yaw * kOneDegree, (least_yaw + uniform(0, 20)) * kOneDegree};
    view.pitch = {least_pitch * kOneDegree, (least_pitch + uniform(0, 10)) * kOneDegree};
    const auto needed = array_requirements(std::span(&view, 1), picture);
    ASSERT_TRUE(needed);
    Eigen::AlignedBox2d traced;
    constexpr int kSteps = 40;
    for (int i = 0; i <= kSteps; ++i) {
      for (int j = 0; j <= kSteps; ++j) {
        const Eigen::Matrix3d turn =
            (Eigen::AngleAxisd(std::lerp(view.yaw.first, view.yaw.second, 1.0 * i / kSteps),
                               Eigen::Vector3d::UnitY()) *
             Eigen::AngleAxisd(std::lerp(view.pitch.first, view.pitch.second, 1.0 * j / kSteps),
                               Eigen::Vector3d::UnitX()))
                .toRotationMatrix();
        for (const double x : {-1.0, 1.0}) {
          for (const double y : {-1.0, 1.0}) {
            const double half = std::tan(picture.horizontal_fov / 2);
            const Eigen::Vector3d ray =
                turn * Eigen::Vector3d(x * half, y * half / picture.aspect, -1);
            traced.extend(Eigen::Vector2d(view.position.z() * ray.head<2>() / -ray.z()));
          }
        }
      }
    }
    EXPECT_LT((needed->extent.min() - traced.min()).maxCoeff(), 1e-12) << round;
    EXPECT_GT((needed->extent.max() - traced.max()).minCoeff(), -1e-12) << round;
    // Steps of half a degree miss the extreme by little.
    EXPECT_LT((needed->extent.min() - traced.min()).norm(), 1e-3) << round;
    EXPECT_LT((needed->extent.max() - traced.max()).norm(), 1e-3) << round;
  }
}

// Thesis 4.4: 62 degrees, 320 pixels, 60 mm: alias-free from 7.99 m (eq. 4.3).
TEST(LargestSpacing, EqualsThesisEquations) {
  const double pitch = 2 * std::tan(31 * kOneDegree) / 320;
  EXPECT_NEAR(largest_spacing(pitch, {7.99, kInfinite}, 1), 0.06, 2e-5);
  EXPECT_NEAR(largest_spacing(pitch, {2, 4}, 1), 2 * pitch / 0.25, 1e-15);
  EXPECT_NEAR(largest_spacing(pitch, {2, 4}, 3), 6 * pitch / 0.25, 1e-15);
  EXPECT_TRUE(std::isinf(largest_spacing(pitch, {3, 3}, 1)));
  for (const double spacing : {1e-9, 0.06, 1e7}) {
    const double ghosting = ghosting_at_spacing(pitch, {2, 4}, spacing);
    EXPECT_NEAR(largest_spacing(pitch, {2, 4}, ghosting) / spacing, 1, 1e-12);
  }
}

TEST(FovOfRotatedCameras, IsThatOfTheNearestCamera) {
  const Eigen::AlignedBox2d extent(Eigen::Vector2d(1, -1), Eigen::Vector2d(2, 1));
  EXPECT_NEAR(*fov_of_rotated_cameras(extent, 3, 0.5), 2 * std::asin(0.5 / 3), 1e-12);
  EXPECT_FALSE(fov_of_rotated_cameras(extent, 0.1, 2));
}

}  // namespace
}  // namespace raystage::rig
