// SPDX-License-Identifier: Apache-2.0
#include "render/common/focal_surface.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "testing/render/synthetic_take.h"

namespace raystage::render::focal_surface_test {
namespace {

using Eigen::Vector3d;

double meet(const RaySurface& surface, const WorldRay& ray) {
  double inverse = 0;
  surface({&ray, 1}, {&inverse, 1});
  return inverse;
}

Vector3d random_vector(std::mt19937& random) {
  std::normal_distribution<double> part;
  return {part(random), part(random), part(random)};
}

TEST(FocalSurface, RaysWithinASphereMeetItOnceInFront) {
  std::mt19937 random(3);
  const Vector3d centre(1e3, -20, 5);
  for (const double radius : {1e-3, 1.0, 4.0, 1e6}) {
    const RaySurface sphere = sphere_surface(centre, radius);
    for (int i = 0; i < 1000; ++i) {
      const Vector3d inside = random_vector(random).normalized() * radius * (i % 10) * 0.0999;
      const WorldRay ray{centre + inside, random_vector(random).normalized()};
      const double inverse = meet(sphere, ray);
      ASSERT_GT(inverse, 0);
      const Vector3d point = ray.origin - centre + ray.direction / inverse;
      EXPECT_NEAR(point.norm() / radius, 1, 1e-9 + 1e-12 / radius);
    }
  }
}

TEST(FocalSurface, RaysFromOutsideMeetTheFarSideOrNothing) {
  const RaySurface sphere = sphere_surface({0, 0, 0}, 2);
  EXPECT_NEAR(meet(sphere, {{0, 0, 5}, {0, 0, -1}}), 1.0 / 7, 1e-12);
  EXPECT_TRUE(std::isnan(meet(sphere, {{0, 0, 5}, {0, 0, 1}})));
  EXPECT_TRUE(std::isnan(meet(sphere, {{0, 3, 0}, {0, 0, 1}})));
}

rig::Rig ring(bool outwards) {
  schemas::RigDocument document;
  auto cameras = testing::camera_grid(1, 8, 0.06, 64, 48);
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    const double turn = 2 * M_PI * static_cast<double>(i) / 8;
    const double c = std::cos(turn), s = std::sin(turn);
    if (outwards) {  // at (s, 0, c), looks there
      cameras[i].world_from_camera = {-c, 0, -s, s, 0, 1, 0, 0, s, 0, -c, c, 0, 0, 0, 1};
    } else {
      cameras[i].world_from_camera = {1, 0, 0, s, 0, 1, 0, c, 0, 0, 1, 0, 0, 0, 0, 1};
    }
    cameras[i].row.reset();
    cameras[i].column.reset();
    document.cameras.push_back({cameras[i], {}});
  }
  return rig::rig_from_document(document);
}

TEST(FocalSurface, ArraysThatLookAroundFocusOnASphere) {
  const rig::Rig around = ring(true), ahead = ring(false);
  ASSERT_TRUE(around.looks_around());
  ASSERT_FALSE(ahead.looks_around());
  const Eigen::Vector4d plane(0, 0, 1, 5);
  const WorldRay forward{{0, 0, 0}, {0, 0, -1}}, aside{{0, 0, 0}, {1, 0, 0}};
  EXPECT_NEAR(meet(focal_surface(around, plane), forward), 0.2, 1e-12);
  EXPECT_NEAR(meet(focal_surface(around, plane), aside), 0.2, 1e-12);
  EXPECT_NEAR(meet(focal_surface(ahead, plane), forward), 0.2, 1e-12);
  EXPECT_TRUE(std::isnan(meet(focal_surface(ahead, plane), aside)));
  EXPECT_EQ(meet(focal_surface(around, {0, 0, 0, 1}), aside), 0);
}

}  // namespace
}  // namespace raystage::render::focal_surface_test
