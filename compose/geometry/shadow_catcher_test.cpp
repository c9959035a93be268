// SPDX-License-Identifier: Apache-2.0
#include "compose/geometry/shadow_catcher.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <cmath>
#include <limits>

#include "compose/geometry/bsdf_sampling.h"
#include "testing/compose/test_meshes.h"

namespace raystage::compose {
namespace {

using Eigen::Vector3d;
using Eigen::Vector3f;

constexpr double kRadius = 0.5, kAbove = 0.8;  // of a ball above a floor at y = -1
const Vector3d kBall(0, -1 + kAbove, -4);

/// A light field of a white floor with correct depth.
class CastShadows : public ::testing::Test {
 protected:
  CastShadows() {
    rig::Pose pose;
    pose.position = {0, 0.5, 0};
    pose.world_from_camera_rotation =
        Eigen::AngleAxisd(-0.35, Vector3d::UnitX()).toRotationMatrix();
    camera_ = render::virtual_camera_with_fov(96, 72, 0.9, pose);
    scene_.meshes = {testing::make_instance(ball_, kBall)};
  }

  Vector3d ray_of(int x, int y) const {
    const schemas::Intrinsics& k = camera_.intrinsics;
    return {(x + 0.5 - k.cx) / k.fx, -(y + 0.5 - k.cy) / k.fy, -1};
  }
  LayerImage floor() const {
    LayerImage image = transparent_layer_image(camera_.width, camera_.height);
    for (int y = 0; y < image.height; ++y) {
      for (int x = 0; x < image.width; ++x) {
        const Vector3d along = camera_.pose.world_from_camera_rotation * ray_of(x, y);
        const double z = (-1 - camera_.pose.position.y()) / along.y();
        if (!(z > 0)) continue;
        image.z[at(x, y)] = static_cast<float>(z);
        std::fill_n(&image.rgba[4 * at(x, y)], 4, 1.0F);
      }
    }
    return image;
  }
  LayerImage shadowed(const ShadowCatcher& settings) const {
    LayerImage image = floor();
    apply_shadow_catcher(scene_, camera_, settings, image);
    return image;
  }
  Vector3d point(const LayerImage& image, int x, int y) const {
    return camera_.pose.world_from_camera(ray_of(x, y) * double{image.z[at(x, y)]});
  }
  std::size_t at(int x, int y) const { return static_cast<std::size_t>(y * camera_.width + x); }

  EmbreeMesh ball_{testing::ball(kRadius, testing::make_material(Material::Kind::kDiffuse), 96),
                   "ball"};
  GeometryScene scene_;
  render::VirtualCamera camera_;
};

TEST_F(CastShadows, FromEverywhereByTheAngleThatABallFills) {
  scene_.lights.ambient = {1, 1, 1};
  const LayerImage image = shadowed({.reach = 100, .rays = 4096});
  int looked_at = 0;
  for (int y = 0; y < image.height; y += 3) {
    for (int x = 0; x < image.width; x += 3) {
      if (image.rgba[4 * at(x, y) + 3] == 0) continue;
      // A cone of half angle a fills 1 - cos(a) of a half-space.
      const double sine = kRadius / (kBall - point(image, x, y)).norm();
      const double open = std::sqrt(1 - sine * sine);
      EXPECT_NEAR(image.rgba[4 * at(x, y)], open, 0.006) << x << ' ' << y;
      looked_at += open < 0.9;
    }
  }
  EXPECT_GT(looked_at, 20);
  const LayerImage quick = shadowed({.reach = 100});
  double worst = 0;
  for (std::size_t i = 0; i < image.rgba.size(); ++i) {
    worst = std::max(worst, std::abs(double{image.rgba[i]} - double{quick.rgba[i]}));
  }
  EXPECT_LT(worst, 0.1);
}

TEST_F(CastShadows, OfALightFarAwayWhereTheBallHidesIt) {
  scene_.lights.ambient = {0.25F, 0.25F, 0.25F};
  const Vector3d towards = Vector3d(-0.3, 1, 0.1).normalized();
  scene_.lights.direct = {{towards, {0.75F, 0.75F, 0.25F}, true}};
  const LayerImage image = shadowed({.rays = 0});
  const Vector3f dark(0.25F, 0.25F, 0.5F);
  int hidden = 0;
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      if (image.rgba[4 * at(x, y) + 3] == 0) continue;
      const Vector3d to_ball = kBall - point(image, x, y);
      const double off = to_ball.cross(towards).norm();
      if (std::abs(off - kRadius) < 0.1) continue;  // a pixel, and the ball has edges
      const bool is_hidden = off < kRadius && to_ball.dot(towards) > 0;
      hidden += is_hidden;
      for (std::size_t c = 0; c < 3; ++c) {
        EXPECT_NEAR(image.rgba[4 * at(x, y) + c],
                    is_hidden ? dark(static_cast<Eigen::Index>(c)) : 1.0F, 1e-6)
            << x << ' ' << y;
      }
      EXPECT_EQ(image.rgba[4 * at(x, y) + 3], 1);
    }
  }
  EXPECT_GT(hidden, 100);
}

TEST_F(CastShadows, EdgesHaveNoStairs) {
  // A coarse picture against the mean of a fine one.
  const Vector3d towards = Vector3d(-0.3, 1, 0.1).normalized();
  scene_.lights.direct = {{towards, {1, 1, 1}, true}};
  const LayerImage coarse = shadowed({.rays = 0});
  constexpr int kFine = 8;
  const render::VirtualCamera before = camera_;
  camera_ = render::virtual_camera_with_fov(96 * kFine, 72 * kFine, 0.9, before.pose);
  const LayerImage fine = shadowed({.rays = 0});
  camera_ = before;
  int partly = 0;
  double worst = 0;
  for (int y = 0; y < coarse.height; ++y) {
    for (int x = 0; x < coarse.width; ++x) {
      if (coarse.rgba[4 * at(x, y) + 3] == 0 || y < coarse.height / 2) continue;
      double mean = 0;
      for (int sub = 0; sub < kFine * kFine; ++sub) {
        const int row = y * kFine + sub / kFine, column = x * kFine + sub % kFine;
        mean += double{fine.rgba[4 * static_cast<std::size_t>(row * fine.width + column)]};
      }
      mean /= kFine * kFine;
      partly += mean > 0.2 && mean < 0.8;
      worst = std::max(worst, std::abs(mean - double{coarse.rgba[4 * at(x, y)]}));
    }
  }
  EXPECT_GT(partly, 10);
  EXPECT_LT(worst, 0.13) << "one shadow ray per pixel: 0.5 and more";
}

TEST_F(CastShadows, OfALightWithASizeByTheShareThatIsHidden) {
  DirectLight lamp;
  lamp.position = Vector3d(-0.8, 1.5, -3.6);
  lamp.radius = 0.3;
  scene_.lights.direct = {lamp};
  const LayerImage image = shadowed({.rays = 0});
  int partly = 0;
  for (int y = 0; y < image.height; y += 2) {
    for (int x = 0; x < image.width; x += 2) {
      if (image.rgba[4 * at(x, y) + 3] == 0) continue;
      const Vector3d from = point(image, x, y);
      // The share of the lamp's disc that the ball hides: sampled finely, analytically per ray.
      int hidden = 0;
      constexpr std::uint32_t kRays = 4000;
      for (std::uint32_t i = 0; i < kRays; ++i) {
        const LightSample sample = sample_light(lamp, from, r2_sample(1, i));
        const Vector3d to_ball = kBall - from;
        const double along = to_ball.dot(sample.towards);
        hidden += along > 0 && along < sample.distance + kRadius &&
                  to_ball.cross(sample.towards).norm() < kRadius;
      }
      const double open = 1 - hidden / double{kRays};
      partly += open > 0.1 && open < 0.9;
      EXPECT_NEAR(image.rgba[4 * at(x, y)], open, 0.08) << x << ' ' << y;
    }
  }
  EXPECT_GT(partly, 20);
}

TEST_F(CastShadows, AnOccluderBehindALampHidesNothingOfIt) {
  DirectLight lamp;
  lamp.position = Vector3d(0, -0.95, -4);  // below the ball, above the floor
  scene_.lights.direct = {lamp};
  EXPECT_EQ(shadowed({.rays = 0}).rgba, floor().rgba);
}

TEST_F(CastShadows, NothingChangesOutOfReachOrWithoutStrength) {
  scene_.lights.ambient = {1, 1, 1};
  EXPECT_EQ(shadowed({.strength = 0}).rgba, floor().rgba);
  EXPECT_EQ(shadowed({.reach = kAbove - kRadius - 0.01}).rgba, floor().rgba);
  scene_.meshes.clear();
  EXPECT_EQ(shadowed({}).rgba, floor().rgba);
}

TEST_F(CastShadows, StrengthIsAShareOfWhatIsTakenAway) {
  const LayerImage all = shadowed({.reach = 2}), half = shadowed({.strength = 0.5, .reach = 2});
  float least = 1;
  for (std::size_t i = 0; i < all.rgba.size(); i += 4) {
    if (all.rgba[i + 3] == 0) continue;
    EXPECT_NEAR(1 - half.rgba[i], 0.5F * (1 - all.rgba[i]), 1e-6);
    least = std::min(least, all.rgba[i]);
  }
  EXPECT_LT(least, 0.9F) << "without any light it comes from everywhere";
}

TEST_F(CastShadows, SkyAndDirectionsStayAsTheyAre) {
  LayerImage image = floor();
  std::ranges::fill(image.z, std::numeric_limits<float>::infinity());
  apply_shadow_catcher(scene_, camera_, {}, image);
  EXPECT_EQ(image.rgba, floor().rgba);
}

TEST_F(CastShadows, SameBytesForAnyNumberOfThreads) {
  const LayerImage many = shadowed({.reach = 2});
  const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
  EXPECT_EQ(shadowed({.reach = 2}).rgba, many.rgba);
}

}  // namespace
}  // namespace raystage::compose
