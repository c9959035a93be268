// SPDX-License-Identifier: Apache-2.0
#include "rig/fisheye_lens.h"

#include <gtest/gtest.h>

#include <boost/multiprecision/cpp_bin_float.hpp>
#include <cmath>
#include <iomanip>
#include <limits>
#include <numbers>
#include <random>
#include <sstream>

#include "base/error.h"
#include "rig/brown_conrady.h"
#include "rig/camera_model.h"
#include "schemas/projection_names.h"

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

/// Pinholes without and with distortion: of webcams, tangential, with k3, pincushion.
std::vector<schemas::Intrinsics> pinholes() {
  std::vector<schemas::Intrinsics> all;
  for (const schemas::Distortion& distortion :
       {schemas::Distortion{}, schemas::Distortion{-0.2, 0.05, 0, 0, 0},
        schemas::Distortion{-0.15, 0.04, 1e-3, -2e-3, 0},
        schemas::Distortion{-0.3, 0.12, 0, 5e-4, -0.02}, schemas::Distortion{0.1, 0.01, 0, 0, 0}}) {
    all.push_back({1115.08, 1113.2, 1682.09, 1083.95, distortion});
  }
  return all;
}

/// Returns the largest angle to the axis at which rays of a lens are tested, radians. A pinhole's
/// distortion ends where it folds back.
double largest_tested_angle(const CameraModel& model) {
  if (model.fisheye() != nullptr) return model.fisheye()->largest_angle();
  constexpr double kWidest = 80 * kPi / 180, kOfFold = 0.95;
  return std::min(kWidest, std::atan(kOfFold * fold_radius(model.intrinsics().distortion)));
}

/// Projects and unprojects random rays of a lens; returns the largest angle between them, radians:
/// infinity if one has no pixel, or the ray of a fisheye's pixel is not of unit length.
double largest_ray_error(const CameraModel& model, int rays, std::mt19937_64& random) {
  const double largest = largest_tested_angle(model);
  double worst = 0;
  for (int i = 0; i < rays;) {
    const Eigen::Vector3d image = random_direction(random, largest);
    const Eigen::Vector3d ray(image.x(), -image.y(), -image.z());
    // Where the distance hardly rises any more, a pixel's last digit is a large angle. The opposite
    // of the axis is a circle.
    const double angle = angle_between(ray, -Eigen::Vector3d::UnitZ());
    const FisheyeLens* fisheye = model.fisheye();
    if (fisheye != nullptr && (fisheye->slope(angle) < 1e-3 || angle > kPi - 1e-6)) continue;
    ++i;
    const auto pixel = model.project(ray * 2.5);
    const auto back = pixel ? model.unproject(*pixel) : std::nullopt;
    const bool is_ray = back && (fisheye == nullptr || std::abs(back->norm() - 1) <= 1e-15);
    if (!is_ray) return std::numeric_limits<double>::infinity();
    worst = std::max(worst, angle_between(*back, ray));
  }
  return worst;
}

/// Notes the largest error of a test for docs/numerics.md (--gtest_output=xml).
void record_worst(const char* what, double error) {
  std::ostringstream text;
  text << std::scientific << std::setprecision(1) << error;
  ::testing::Test::RecordProperty(what, text.str());
}

class LensModels : public ::testing::TestWithParam<Projection> {};

TEST_P(LensModels, ReturnAMillionRays) {
  std::mt19937_64 random(20051);
  std::vector<schemas::Intrinsics> of_projection = pinholes();
  for (const schemas::Intrinsics& fisheye : lenses()) of_projection.push_back(fisheye);
  std::erase_if(of_projection, [](const auto& lens) { return lens.projection != GetParam(); });
  ASSERT_GE(of_projection.size(), 4U);
  const int rays = 1'000'000 / static_cast<int>(of_projection.size()) + 1;
  double worst = 0;
  for (const schemas::Intrinsics& intrinsics : of_projection) {
    const double error = largest_ray_error(fisheye_camera(intrinsics), rays, random);
    EXPECT_LE(error, 1e-9) << intrinsics.radial_distortion[0] << " " << intrinsics.distortion.k1;
    worst = std::max(worst, error);
  }
  record_worst("angle", worst);
}

INSTANTIATE_TEST_SUITE_P(All, LensModels, ::testing::ValuesIn(schemas::projections()),
                         [](const auto& of) { return std::string(name_of(of.param)); });

/// A number in [0, largest]: anywhere, next to 0 or next to the end.
double random_up_to(std::mt19937_64& random, int kind, double largest) {
  std::uniform_real_distribution<double> part(0, 1);
  if (kind == 0) return largest * part(random);
  const double small = std::pow(10, -1 - 15 * part(random));
  return kind == 1 ? largest * small : largest * (1 - small);
}

TEST(FisheyeLens, AgreesWithFiftyDigits) {
  std::mt19937_64 random(7);
  double worst = 0;
  for (const schemas::Intrinsics& intrinsics : lenses()) {
    const FisheyeLens lens(intrinsics);
    for (int i = 0; i < 400; ++i) {
      // Also next to the axis, to the camera's plane and to the largest angle, and of any length.
      const double angle = random_up_to(random, i % 4 == 3 ? 2 : 0, lens.largest_angle());
      const double turn = random_up_to(random, 0, 2 * kPi);
      Eigen::Vector3d direction(std::sin(angle) * std::cos(turn), std::sin(angle) * std::sin(turn),
                                std::cos(angle));
      if (i % 4 == 1) direction = {1e-12 * direction.x(), 1e-150, 1};
      if (i % 4 == 2) direction = {direction.x(), direction.y(), 1e-14 * direction.z()};
      if (i % 8 >= 4) direction *= 1e100;
      const auto point = lens.image_from_direction(direction);
      if (!point) {
        EXPECT_EQ(i % 4, 2) << angle;  // the lens does not reach the camera's plane
        continue;
      }
      const Exact x = direction.x(), y = direction.y(), z = direction.z();
      const Exact across = sqrt(x * x + y * y);
      const Exact distance = exact_distance(intrinsics, atan2(across, z));
      const Exact error_x = Exact(point->x()) - distance * x / across;
      const Exact error_y = Exact(point->y()) - distance * y / across;
      const double error = static_cast<double>(sqrt(error_x * error_x + error_y * error_y)) /
                           std::max(1e-3, point->norm());
      EXPECT_LE(error, 1e-15);
      worst = std::max(worst, error);
    }
  }
  record_worst("distance", worst);
}

/// Returns the angle of a distance by Newton's method from an approximate one.
Exact exact_angle(const schemas::Intrinsics& lens, const Exact& distance, double start) {
  const Exact step("1e-18");
  Exact angle = start;
  for (int i = 0; i < 6; ++i) {
    const Exact slope =
        (exact_distance(lens, angle + step) - exact_distance(lens, angle - step)) / (2 * step);
    angle -= (exact_distance(lens, angle) - distance) / slope;
  }
  return angle;
}

// An angle is as exact as the distance, which is rounded, determines it: its own distance is right
// to two roundings. Where the distance rises by at least a thousandth of what it does in the middle
// rays are within 5e-13.
TEST(FisheyeLens, InvertsDistancesAsFiftyDigitsDo) {
  std::mt19937_64 random(8);
  double worst_distance = 0, worst_ray = 0;
  for (const schemas::Intrinsics& intrinsics : lenses()) {
    const FisheyeLens lens(intrinsics);
    const double end = lens.distance(lens.largest_angle());
    for (int i = 0; i < 400; ++i) {
      const double distance = random_up_to(random, i % 3, end);
      const auto angle = lens.angle(distance);
      ASSERT_TRUE(angle) << distance;
      const Exact excess = exact_distance(intrinsics, Exact(*angle)) - Exact(distance);
      const double of_distance = static_cast<double>(abs(excess)) / std::max(1e-3, distance);
      EXPECT_LE(of_distance, 5e-16);
      worst_distance = std::max(worst_distance, of_distance);

      const double turn = random_up_to(random, 0, 2 * kPi);
      const Eigen::Vector2d point(distance * std::cos(turn), distance * std::sin(turn));
      const Exact x = point.x(), y = point.y(), across = sqrt(x * x + y * y);
      const auto ray = lens.direction_from_image(point);
      if (!ray || lens.slope(*angle) < 1e-3) continue;
      const Exact exact = exact_angle(intrinsics, across, *angle);
      const Exact error_x = Exact(ray->x()) - sin(exact) * x / across,
                  error_y = Exact(ray->y()) - sin(exact) * y / across,
                  error_z = Exact(ray->z()) - cos(exact);
      const auto of_ray =
          static_cast<double>(sqrt(error_x * error_x + error_y * error_y + error_z * error_z));
      EXPECT_LE(of_ray, 5e-13) << *angle;
      worst_ray = std::max(worst_ray, of_ray);
    }
  }
  record_worst("distance", worst_distance);
  record_worst("ray", worst_ray);
}

// The first of Newton's steps from these distances ends next to 0, from where the next one returns.
TEST(FisheyeLens, InvertsDistancesFromWhichNewtonsStepsAlternate) {
  const FisheyeLens lens(fisheye(Projection::kFtheta, {0.05, -0.01, 0.003, -0.0005}));
  const auto end_of_step = [&](double r) { return r - (lens.distance(r) - r) / lens.slope(r); };
  double low = 2, high = lens.largest_angle();
  for (int i = 0; i < 100; ++i) {
    const double middle = low + (high - low) / 2;
    (end_of_step(middle) > 0 ? low : high) = middle;
  }
  for (const double before : {0.0, 1e-6, 8.2e-6, 9e-6, 1e-5, 1.2e-5, 1.5e-5, 2e-5}) {
    const double distance = low - before;
    EXPECT_NEAR(lens.distance(*lens.angle(distance)), distance, 1e-14) << before;
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
