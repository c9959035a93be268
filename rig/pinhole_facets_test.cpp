// SPDX-License-Identifier: Apache-2.0
#include "rig/pinhole_facets.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>
#include <random>

namespace raystage::rig {
namespace {

using schemas::Projection;

Rig::Camera fisheye(double focal, int width, int height, double turn) {
  schemas::CameraGeometry geometry;
  geometry.id = "f";
  geometry.width = width;
  geometry.height = height;
  geometry.intrinsics = {focal,
                         focal,
                         width / 2.0,
                         height / 2.0,
                         {},
                         Projection::kFtheta,
                         {-0.03, 0, 0, 0},
                         std::numbers::pi / 2};
  Pose pose;
  pose.position = {0.1, 0.2, 0.3};
  pose.world_from_camera_rotation =
      Eigen::AngleAxisd(turn, Eigen::Vector3d(0.2, 1, 0.3).normalized()).toRotationMatrix();
  return {"f", CameraModel(geometry), pose, {}, {}, {}};
}

Rig rig_of(std::vector<Rig::Camera> cameras) {
  Rig rig;
  rig.cameras = std::move(cameras);
  return rig;
}

TEST(PinholeFacets, TogetherShowAllThatTheFrameShows) {
  const Rig rig = rig_of({fisheye(200, 640, 420, 0.7)});
  const auto faceted = pinhole_facets(rig);
  ASSERT_TRUE(faceted);
  EXPECT_EQ(faceted->rig.cameras.size(), 5U) << "a hemisphere has no rays behind it";
  EXPECT_EQ(faceted->camera_of_facet, std::vector<int>(5, 0));
  // Cameras that look in other directions have facets that look in the same ones.
  const auto two = pinhole_facets(rig_of({fisheye(200, 640, 420, 0.7), fisheye(200, 640, 420, 0)}));
  const auto& cameras = two->rig.cameras;
  for (const Rig::Camera& one : cameras) {
    for (const Rig::Camera& other : cameras) {
      const double dot = one.pose.viewing_direction().dot(other.pose.viewing_direction());
      EXPECT_NEAR(std::abs(dot), std::abs(dot) > 0.5 ? 1 : 0, 1e-9);
    }
  }
  std::mt19937 random(3);
  std::uniform_real_distribution<double> unit(-1, 1);
  int seen = 0;
  for (int i = 0; i < 20000; ++i) {
    const Eigen::Vector3d point(unit(random), unit(random), unit(random));
    const auto whole = rig.cameras[0].model.project(rig.cameras[0].pose.camera_from_world(point));
    if (!whole || !rig.cameras[0].model.contains(*whole)) continue;
    ++seen;
    double share = 0;
    for (const Rig::Camera& facet : faceted->rig.cameras) {
      const Eigen::Vector3d in_facet = facet.pose.camera_from_world(point);
      const auto pixel = facet.model.project(in_facet);
      if (!pixel) continue;
      EXPECT_LE((*pixel - *whole).norm(), 1e-9);
      share += facet.model.facet_share(in_facet);
      const auto ray = facet.model.unproject(*pixel);
      ASSERT_TRUE(ray);
      EXPECT_LE(ray->cross(in_facet.normalized()).norm(), 1e-9);
      const auto ideal = facet.model.ideal_from_pixel(*pixel);
      ASSERT_TRUE(ideal);
      EXPECT_LE((*facet.model.pixel_from_ideal(*ideal) - *whole).norm(), 1e-9);
    }
    EXPECT_GE(share, 1 - 1e-9);
  }
  EXPECT_GT(seen, 2000);
}

TEST(PinholeFacets, NarrowLensesHaveNone) {
  schemas::CameraGeometry geometry;
  geometry.id = "p";
  geometry.width = 640;
  geometry.height = 480;
  geometry.intrinsics = {100, 100, 320, 240, {}};
  const Rig::Camera wide_pinhole{"p", CameraModel(geometry), {}, {}, {}, {}};
  EXPECT_FALSE(pinhole_facets(rig_of({wide_pinhole, fisheye(600, 640, 420, 0)})));
  const auto mixed = pinhole_facets(rig_of({wide_pinhole, fisheye(200, 640, 420, 0)}));
  ASSERT_TRUE(mixed);
  EXPECT_EQ(mixed->rig.cameras.size(), 6U);
  EXPECT_EQ(mixed->rig.cameras[0].model.facet(), nullptr);
}

TEST(PinholeFacets, KeepWhereTheArrayIs) {
  const Rig rig = rig_of({fisheye(200, 640, 420, 0), fisheye(600, 640, 420, 2)});
  const auto faceted = pinhole_facets(rig);
  ASSERT_TRUE(faceted);
  EXPECT_EQ(faceted->rig.centre(), rig.centre());
  EXPECT_EQ(faceted->rig.mean_viewing_direction(), rig.mean_viewing_direction());
  EXPECT_TRUE(faceted->rig.looks_around());
}

TEST(Rig, LooksAroundIfItsCamerasLookOutwards) {
  const auto ring = [](double outwards) {
    std::vector<Rig::Camera> cameras;
    for (int i = 0; i < 8; ++i) {
      schemas::CameraGeometry geometry;
      geometry.id = "c";
      geometry.width = 640;
      geometry.height = 480;
      geometry.intrinsics = {500, 500, 320, 240, {}};
      Pose pose;
      const double turn = i * std::numbers::pi / 4;
      pose.world_from_camera_rotation =
          Eigen::AngleAxisd(turn, Eigen::Vector3d::UnitY()).toRotationMatrix();
      pose.position = outwards * pose.viewing_direction();
      cameras.push_back({"c", CameraModel(geometry), pose, {}, {}, {}});
    }
    return rig_of(std::move(cameras));
  };
  EXPECT_TRUE(ring(0.3).looks_around());
  EXPECT_FALSE(ring(-3).looks_around()) << "about a stage";
  EXPECT_NEAR(ring(0.3).depth_of({3, 0, 4}), 5, 1e-12);
  const Rig ahead = rig_of({fisheye(600, 640, 420, 0)});
  EXPECT_FALSE(ahead.looks_around());
  EXPECT_TRUE(rig_of({fisheye(200, 640, 420, 0)}).looks_around());
}

}  // namespace
}  // namespace raystage::rig
