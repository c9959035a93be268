// SPDX-License-Identifier: Apache-2.0
#include "compose/geometry/bsdf_sampling.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace raystage::compose {
namespace {

using Eigen::Vector3d;

constexpr int kRays = 20000;

const Vector3d kNormals[] = {{0, 0, 1}, {0, 0, -1}, {1, 0, 0}, {0.6, -0.48, 0.64}, {-0.6, 0.8, 0}};

TEST(Scattering, NumbersAreSpreadEvenly) {
  for (const std::uint32_t seed : {0U, 1U, 77U, 0xFFFFFFFFU}) {
    int in_corner = 0;
    for (std::uint32_t i = 0; i < 4000; ++i) {
      const auto at = r2_sample(seed, i);
      ASSERT_GE(std::min(at[0], at[1]), 0);
      ASSERT_LT(std::max(at[0], at[1]), 1);
      in_corner += at[0] < 0.25 && at[1] < 0.5 ? 1 : 0;
    }
    EXPECT_NEAR(in_corner, 500, 15);  // uniform: 63
  }
}

TEST(Scattering, DiffuseFollowsTheCosine) {
  for (const Vector3d& normal : kNormals) {
    double cosines = 0, sideways = 0;
    for (std::uint32_t i = 0; i < kRays; ++i) {
      const Vector3d d = sample_diffuse_direction(normal, r2_sample(3, i));
      ASSERT_NEAR(d.norm(), 1, 1e-12);
      ASSERT_GE(d.dot(normal), -1e-12);
      cosines += d.dot(normal) / kRays;
      sideways += normal.unitOrthogonal().dot(d) / kRays;
    }
    EXPECT_NEAR(cosines, 2.0 / 3, 1e-3);
    EXPECT_NEAR(sideways, 0, 1e-2);
  }
}

TEST(Scattering, ANearlySmoothSurfaceMirrors) {
  for (const Vector3d& normal : kNormals) {
    const Vector3d eye = (normal + 0.8 * normal.unitOrthogonal()).normalized();
    const Vector3d mirror = reflect(-eye, normal);
    EXPECT_NEAR(mirror.dot(normal), eye.dot(normal), 1e-12);
    for (std::uint32_t i = 0; i < 100; ++i) {
      const DirectionSample glossy = sample_ggx_direction(normal, eye, 1e-4, r2_sample(5, i));
      EXPECT_GT(glossy.direction.dot(mirror), 1 - 1e-5);
      EXPECT_NEAR(glossy.weight, 1, 1e-6);
    }
  }
}

/// Compares the albedo of a rough white surface (single scattering) with the integral over all
/// directions, which does not sample visible normals.
TEST(Scattering, GlossyGivesBackWhatTheIntegralSays) {
  for (const double alpha : {0.1, 0.4, 1.0}) {
    for (const double tilt : {0.0, 0.8, 1.4}) {
      const Vector3d normal = Vector3d::UnitZ(), eye(std::sin(tilt), 0, std::cos(tilt));
      double sampled = 0;
      for (std::uint32_t i = 0; i < kRays; ++i) {
        sampled += sample_ggx_direction(normal, eye, alpha, r2_sample(7, i)).weight / kRays;
      }
      const auto lambda = [&](double z) {
        return (std::sqrt(1 + alpha * alpha * (1 - z * z) / (z * z)) - 1) / 2;
      };
      double integral = 0;
      constexpr int kPolar = 1500, kTurn = 300;
      for (int p = 0; p < kPolar; ++p) {
        // Integrating over half vectors resolves any narrow peak of D.
        const double share = (p + 0.5) / kPolar, polar = share * share * std::numbers::pi / 2;
        const double step = 2 * share / kPolar * std::numbers::pi / 2;
        const double c = std::cos(polar), s = std::sin(polar);
        const double d =
            alpha * alpha / (std::numbers::pi * std::pow(c * c * (alpha * alpha - 1) + 1, 2));
        for (int t = 0; t < kTurn; ++t) {
          const double turn = 2 * std::numbers::pi * (t + 0.5) / kTurn;
          const Vector3d half(s * std::cos(turn), s * std::sin(turn), c);
          const double view_directions = eye.dot(half);
          if (!(view_directions > 0)) continue;
          const Vector3d out = 2 * view_directions * half - eye;
          if (!(out.z() > 0)) continue;
          const double masking = 1 / (1 + lambda(eye.z()) + lambda(out.z()));
          // f cos dw_out, with dw_out = 4 (eye . half) dw_half.
          integral += d * masking / (4 * eye.z() * out.z()) * out.z() * 4 * view_directions * s *
                      step * (2 * std::numbers::pi / kTurn);
        }
      }
      EXPECT_NEAR(sampled, integral, 5e-3) << alpha << " " << tilt;
      EXPECT_LE(sampled, 1);
    }
  }
}

}  // namespace
}  // namespace raystage::compose
