// SPDX-License-Identifier: Apache-2.0
#include "compose/geometry/lights.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "compose/geometry/bsdf_sampling.h"

namespace raystage::compose {
namespace {

using Eigen::Vector3d;

constexpr double kDegree = std::numbers::pi / 180;
constexpr int kSamples = 20000;

/// Returns what a surface with this normal receives of a light, and checks the samples' directions.
double received(const DirectLight& light, const Vector3d& point, const Vector3d& normal,
                const Vector3d& axis, double half_angle) {
  double sum = 0;
  for (std::uint32_t i = 0; i < kSamples; ++i) {
    const LightSample sample = sample_light(light, point, r2_sample(7, i));
    EXPECT_NEAR(sample.towards.norm(), 1, 1e-9);
    EXPECT_GE(sample.towards.dot(axis), std::cos(half_angle) - 1e-9);
    sum += sample.strength * std::max(0.0, sample.towards.dot(normal));
  }
  return sum / kSamples;
}

TEST(DirectLights, AFacingSurfaceReceivesTheColourForAnySize) {
  const Vector3d towards = Vector3d(1, 2, -3).normalized();
  for (const double degrees : {0.0, 0.001, 0.53, 20.0, 120.0, 170.0}) {
    DirectLight light{towards};
    light.half_angle = degrees / 2 * kDegree;
    EXPECT_NEAR(received(light, Vector3d(5, 5, 5), towards, towards, light.half_angle), 1, 1e-3)
        << degrees;
    // As long as the whole disc is above the surface, the cosine of its centre counts.
    if (degrees > 60) continue;
    const Vector3d tilted = Eigen::AngleAxisd(50 * kDegree, towards.unitOrthogonal()) * towards;
    EXPECT_NEAR(received(light, {}, tilted, towards, light.half_angle), std::cos(50 * kDegree),
                1e-3);
  }
}

TEST(DirectLights, ASphereFadesWithTheSquareOfTheDistance) {
  for (const double radius : {0.0, 1e-4, 0.5, 1.5}) {
    for (const double away : {2.0, 10.0, 1e5}) {
      DirectLight light;
      light.position = Vector3d(1, 1, 1);
      light.radius = radius;
      const Vector3d axis = Vector3d(0, 3, -4).normalized();
      const Vector3d point = *light.position - away * axis;
      const double half_angle = std::asin(radius / away);
      EXPECT_NEAR(received(light, point, axis, axis, half_angle) * away * away, 1, 1e-3)
          << radius << ' ' << away;
      // Rays end at the sphere's surface: the middle's and any other.
      EXPECT_NEAR(sample_light(light, point, {0, 0.4}).distance, away - radius, 1e-9 * away);
      const LightSample sample = sample_light(light, point, {0.9, 0.4});
      const Vector3d end = point + sample.distance * sample.towards;
      EXPECT_NEAR((end - *light.position).norm(), radius, 1e-6 * away);
    }
  }
}

TEST(DirectLights, InsideAndAtTheCentreOfASphereLightStaysFinite) {
  DirectLight light;
  light.position = Vector3d(1, 1, 1);
  for (const double radius : {0.0, 2.0}) {
    light.radius = radius;
    for (const double away : {0.0, 1e-12, 1.0}) {
      const LightSample sample =
          sample_light(light, *light.position + Vector3d(away, 0, 0), {0.5, 0.5});
      EXPECT_TRUE(std::isfinite(sample.strength) && sample.towards.allFinite());
      EXPECT_GE(sample.distance, 0);
    }
  }
}

}  // namespace
}  // namespace raystage::compose
