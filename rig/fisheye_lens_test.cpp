// SPDX-License-Identifier: Apache-2.0
#include "rig/fisheye_lens.h"

#include <gtest/gtest.h>

#include <boost/multiprecision/cpp_bin_float.hpp>
#include <cmath>
#include <numbers>
#include <random>

#include "base/error.h"
#include "rig/camera_model.h"

namespace raystage::rig {
namespace {

using schemas::Projection;
using Exact = boost::multiprecision::cpp_bin_float_50;

constexpr double kPi = std::numbers::pi;

schemas::Intrinsics fisheye(Projection projection, const std::array<double, 4>& distortion = {},
                            std::optional<double> half_angle = {}) {
  schemas::Intrinsics intrinsics{1115.08, 1115.08,    1682.09,    1083.95,
                                 {},      projection, distortion, half_angle};
  return intrinsics;
}

CameraModel fisheye_camera(const schemas::Intrinsics& intrinsics) {
  schemas::CameraGeometry geometry;
  geometry.id = "test";
  geometry.width = 3360;
  geometry.height = 2160;
  geometry.intrinsics = intrinsics;
  return CameraModel(geometry);
}

/// The lenses of facebook360_dep's real rig, of OpenCV's documentation, and extremes.
std::vector<schemas::Intrinsics> lenses() {
  const std::array<double, 4> real{-0.03413328161902581, 0.0004374554953464843,
                                   -0.0018843963208481174, 0};
  std::vector<schemas::Intrinsics> all;
  for (const Projection projection : {Projection::kFisheye, Projection::kFtheta,
                                      Projection::kEquisolid, Projection::kOrthographic}) {
    all.push_back(fisheye(projection));
    all.push_back(fisheye(projection, real, kPi / 2));
    all.push_back(fisheye(projection, {0.05, -0.01, 0.003, -0.0005}));
    all.push_back(fisheye(projection, {-0.3, 0, 0, 0}));  // folds back
  }
  all.push_back(fisheye(Projection::kFtheta, {}, 110 * kPi / 180));
  all.push_back(fisheye(Projection::kEquisolid, real, 140 * kPi / 180));
  return all;
}

Exact exact_distance(const schemas::Intrinsics& lens, const Exact& angle) {
  Exact r = angle;
  if (lens.projection == Projection::kEquisolid) r = 2 * sin(angle / 2);
  if (lens.projection == Projection::kOrthographic) r = sin(angle);
  const Exact s = r * r;
  const auto& k = lens.radial_distortion;
  return r * (1 + s * (k[0] + s * (k[1] + s * (k[2] + s * k[3]))));
}

/// A unit direction with a uniform angle to the axis, up to `largest`.
Eigen::Vector3d random_direction(std::mt19937_64& random, double largest) {
  std::uniform_real_distribution<double> part(0, 1);
  const double angle = largest * part(random), turn = 2 * kPi * part(random);
  return {std::sin(angle) * std::cos(turn), std::sin(angle) * std::sin(turn), std::cos(angle)};
}

double angle_between(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b));
}

TEST(FisheyeLens, MapsAngles) {
  const double angle = 0.7;
  const Eigen::Vector3d direction(std::sin(angle), 0, std::cos(angle));
  const auto x = [&](Projection projection) {
    return FisheyeLens(fisheye(projection)).image_from_direction(direction * 5)->x();
  };
  EXPECT_NEAR(x(Projection::kFisheye), angle, 1e-15);
  EXPECT_NEAR(x(Projection::kFtheta), angle, 1e-15);
  EXPECT_NEAR(x(Projection::kEquisolid), 2 * std::sin(angle / 2), 1e-15);
  EXPECT_NEAR(x(Projection::kOrthographic), std::sin(angle), 1e-15);
}

TEST(FisheyeLens, ReturnsAMillionRays) {
  std::mt19937_64 random(20051);
  const auto all = lenses();
  const int rays = 1'000'000 / static_cast<int>(all.size()) + 1;
  for (const schemas::Intrinsics& intrinsics : all) {
    const CameraModel model = fisheye_camera(intrinsics);
    const double largest = model.fisheye()->largest_angle();
    for (int i = 0; i < rays; ++i) {
      const Eigen::Vector3d image = random_direction(random, largest);
      const Eigen::Vector3d ray(image.x(), -image.y(), -image.z());
      // Where the distance hardly rises any more, a pixel's last digit is a large angle. The
      // opposite of the axis is a circle.
      const double angle = angle_between(ray, -Eigen::Vector3d::UnitZ());
      if (model.fisheye()->slope(angle) < 1e-3 || angle > kPi - 1e-6) continue;
      const auto pixel = model.project(ray * 2.5);
      ASSERT_TRUE(pixel);
      const auto back = model.unproject(*pixel);
      ASSERT_TRUE(back);
      ASSERT_NEAR(back->norm(), 1, 1e-15);
      ASSERT_LE(angle_between(*back, ray), 1e-9) << angle;
    }
  }
}

TEST(FisheyeLens, AgreesWithFiftyDigits) {
  std::mt19937_64 random(7);
  for (const schemas::Intrinsics& intrinsics : lenses()) {
    const FisheyeLens lens(intrinsics);
    for (int i = 0; i < 200; ++i) {
      // Also next to the axis, to the camera's plane and to the largest angle.
      Eigen::Vector3d direction = random_direction(random, lens.largest_angle());
      if (i % 4 == 1) direction = {1e-12 * direction.x(), 1e-150, 1};
      if (i % 4 == 2) direction = {direction.x(), direction.y(), 1e-14 * direction.z()};
      if (i % 4 == 3) direction *= 1e100;
      const auto point = lens.image_from_direction(direction);
      if (!point) continue;
      const Exact x = direction.x(), y = direction.y(), z = direction.z();
      const Exact across = sqrt(x * x + y * y);
      const Exact distance = exact_distance(intrinsics, atan2(across, z));
      const Exact error_x = Exact(point->x()) - distance * x / across;
      const Exact error_y = Exact(point->y()) - distance * y / across;
      EXPECT_LE(static_cast<double>(sqrt(error_x * error_x + error_y * error_y)),
                2e-15 * std::max(1e-3, point->norm()));
    }
  }
}

TEST(FisheyeLens, HasTheSlopeOfItsDistance) {
  for (const schemas::Intrinsics& intrinsics : lenses()) {
    const FisheyeLens lens(intrinsics);
    for (const double part : {0.0, 0.2, 0.5, 0.9, 0.999}) {
      const Exact angle = part * lens.largest_angle(), step = 1e-15;
      const Exact slope =
          (exact_distance(intrinsics, angle + step) - exact_distance(intrinsics, angle - step)) /
          (2 * step);
      EXPECT_NEAR(lens.slope(static_cast<double>(angle)), static_cast<double>(slope), 1e-13);
    }
  }
}

TEST(FisheyeLens, EndsAtItsHalfAngle) {
  const double half = 110 * kPi / 180;
  const CameraModel model = fisheye_camera(fisheye(Projection::kFtheta, {}, half));
  const auto at = [&](double angle) {
    return model.project({std::sin(angle), 0, -std::cos(angle)});
  };
  EXPECT_TRUE(at(half - 1e-9));
  EXPECT_FALSE(at(half + 1e-9));
  // Behind the camera's plane, and yet seen: there is a ray, but no ideal image point.
  const auto behind = at(100 * kPi / 180);
  ASSERT_TRUE(behind);
  EXPECT_TRUE(model.unproject(*behind));
  EXPECT_GT(model.unproject(*behind)->z(), 0);
  EXPECT_FALSE(model.ideal_from_pixel(*behind));
  // The whole sphere but one direction.
  const CameraModel sphere = fisheye_camera(fisheye(Projection::kEquisolid));
  EXPECT_TRUE(sphere.project({1e-9, 0, 1}));
  EXPECT_FALSE(sphere.project({0, 0, 1}));
  EXPECT_FALSE(sphere.project({0, 0, 0}));
  EXPECT_FALSE(sphere.project({std::nan(""), 0, -1}));
  EXPECT_FALSE(sphere.project({std::numeric_limits<double>::infinity(), 0, -1}));
  EXPECT_FALSE(sphere.unproject({std::nan(""), 0}));
}

TEST(FisheyeLens, EndsWhereItsDistortionFoldsBack) {
  const FisheyeLens lens(fisheye(Projection::kFtheta, {-0.3, 0, 0, 0}));
  EXPECT_NEAR(lens.largest_angle(), std::sqrt(1 / 0.9), 1e-12);
  EXPECT_FALSE(lens.angle(lens.distance(lens.largest_angle()) * 1.000001));
  EXPECT_NEAR(*lens.angle(lens.distance(0.8)), 0.8, 1e-14);
}

TEST(FisheyeLens, HasIdealPointsInFrontOfTheCamera) {
  const CameraModel model = fisheye_camera(fisheye(Projection::kFisheye, {-0.03, 0, 0, 0}));
  EXPECT_TRUE(model.has_distortion());
  const Eigen::Vector2d ideal(3, -2);
  const auto pixel = model.pixel_from_ideal(ideal);
  ASSERT_TRUE(pixel);
  EXPECT_LE((*pixel - *model.project({3, 2, -1})).norm(), 1e-10);
  EXPECT_LE((*model.ideal_from_pixel(*pixel) - ideal).norm(), 1e-12);
}

TEST(FisheyeLens, RefusesToSeeNothing) {
  for (const schemas::Intrinsics& bad :
       {fisheye(Projection::kFtheta, {-1e9, 0, 0, 0}), fisheye(Projection::kFtheta, {}, 1e-9),
        fisheye(Projection::kFtheta, {std::nan(""), 0, 0, 0}),
        fisheye(Projection::kFtheta, {}, std::nan(""))}) {
    EXPECT_THROW(fisheye_camera(bad), Error);
  }
}

}  // namespace
}  // namespace raystage::rig
