// SPDX-License-Identifier: Apache-2.0
#include "render/depth/camera_depths.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <functional>
#include <string>

#include "base/error.h"
#include "render/common/ray_cells.h"
#include "render/depth/estimation_kernels.h"
#include "testing/render/synthetic_take.h"
#include "testing/test_simd_targets.h"

namespace raystage::render {
namespace {

using Eigen::Vector3d;
using testing::SyntheticTake;

constexpr double kWall = 2.5, kBack = 5;  // distances in metres

/// Returns the depth along a ray: left of x = 0.1 a wall, behind it another one.
double depth_along(const Vector3d& from, const Vector3d& direction) {
  const double wall = (-kWall - from.z()) / direction.z();
  return (from + wall * direction).x() < 0.1 ? wall : (-kBack - from.z()) / direction.z();
}
std::array<double, 3> scene(const Vector3d& from, const Vector3d& direction) {
  const Vector3d hit = from + depth_along(from, direction) * direction;
  const auto coarse = testing::painted_plane(1.5 * hit.x(), 1.5 * hit.y() - hit.z());
  const auto fine = testing::painted_plane(4 * hit.x() + 1, 4 * hit.y());
  return {(coarse[0] + fine[1]) / 2, (coarse[1] + fine[2]) / 2, (coarse[2] + fine[0]) / 2};
}

/// Bars in front of a wall without texture behind them: its depth cannot be matched there.
std::array<double, 3> bars_scene(const Vector3d& from, const Vector3d& direction) {
  const Vector3d bar = from + (-kWall - from.z()) / direction.z() * direction;
  const double period = bar.x() / 0.35 - std::floor(bar.x() / 0.35);
  if (std::abs(bar.x()) < 0.5 && period < 0.25) return testing::painted_plane(9 * bar.x(), bar.y());
  const Vector3d back = from + (-kBack - from.z()) / direction.z() * direction;
  const bool is_beside = std::abs(back.x()) > 1.05;
  const double light =
      0.4 + (is_beside ? 0.15 * std::sin(9 * back.x()) * std::cos(7 * back.y() + back.x()) : 0);
  return {light, 0.9 * light, 0.5 * light};
}

class CameraDepthsTest : public ::testing::Test {
 protected:
  void record(int rows, int columns, int width, int height, const schemas::Distortion& distortion) {
    SyntheticTake options;
    options.cameras = testing::camera_grid(rows, columns, 0.1, width, height, distortion);
    // Not exactly in rows, so that no sample falls on the border of two rows of pixels.
    for (std::size_t i = 0; i < options.cameras.size(); ++i) {
      auto& pose = options.cameras[i].world_from_camera;
      pose[3] += 0.0041 * (static_cast<double>(i * 7 % 5) - 2);
      pose[7] += 0.0033 * (static_cast<double>(i * 5 % 7) - 3);
      pose[11] += 0.0027 * (static_cast<double>(i * 3 % 4) - 1);
    }
    options.depth_range = schemas::DepthRange{2.2, 6};
    options.scene = scene_;
    write_synthetic_take(options, folder_.path() / "take");
    take_ = std::make_unique<store::Take>(folder_.path() / "take");
    cache_ = std::make_unique<store::FrameCache>(*take_, std::size_t{1} << 28,
                                                 store::BlendSpace::kPerceptual);
    instant_.take = take_.get();
    instant_.rig = &take_->rig();
    instant_.cache = cache_.get();
    instant_.frame_of_camera.assign(take_->rig().cameras.size(), 0);
    options_.scene = *options.depth_range;
  }

  /// Compares the depths with those of the reference, for all instruction sets.
  void expect_reference() const {
    const CameraDepths slow = estimate_camera_depths_reference(instant_, options_);
    testing::for_each_simd_target(depth_estimation_target, [&] {
      const CameraDepths fast = estimate_camera_depths(instant_, options_, std::size_t{1} << 30);
      int all = 0, known = 0, differ = 0;
      for (std::size_t camera = 0; camera < slow.maps.size(); ++camera) {
        ASSERT_EQ(fast.maps[camera].values.size(), slow.maps[camera].values.size());
        for (std::size_t i = 0; i < slow.maps[camera].values.size(); ++i) {
          const float expected = slow.maps[camera].values[i], found = fast.maps[camera].values[i];
          ++all;
          known += expected >= 0 ? 1 : 0;
          // The tolerance is a hundredth of a pixel of disparity, except where rounding decides a
          // choice.
          const bool is_other = (found < 0) != (expected < 0);
          differ +=
              is_other || std::abs(found - expected) > 0.01 * slow.inverse_depth_per_pixel ? 1 : 0;
        }
      }
      EXPECT_GT(known, all / 2);
      EXPECT_LT(known, all);
      EXPECT_LE(differ, all / 1000);
    });
  }

  std::function<std::array<double, 3>(const Vector3d&, const Vector3d&)> scene_ = scene;
  testing::TestFolder folder_;
  std::unique_ptr<store::Take> take_;
  std::unique_ptr<store::FrameCache> cache_;
  LightFieldFrame instant_;
  DepthEstimationOptions options_;
};

constexpr std::size_t kPlenty = std::size_t{1} << 30;
const schemas::Distortion kBarrel{-0.15, 0.02, 0.001, -0.002, 0};

TEST_F(CameraDepthsTest, AgreesWithTheReferenceOnEveryInstructionSet) {
  record(3, 3, 56, 42, kBarrel);
  expect_reference();
}

// The wall is seen between the bars, as in the reference.
TEST_F(CameraDepthsTest, FindsAPlainBackgroundBetweenBars) {
  scene_ = bars_scene;
  record(3, 3, 72, 54, kBarrel);
  expect_reference();
  const CameraDepths depths = estimate_camera_depths(instant_, options_, kPlenty);
  const VirtualCamera& pinhole = depths.pinholes[4];
  const Eigen::Matrix3d ray_from_pixel = world_ray_from_pixel(pinhole);
  int between = 0, found = 0;
  for (int y = 0; y < pinhole.height; ++y) {
    for (int x = 0; x < pinhole.width; ++x) {
      const Vector3d ray = ray_from_pixel * Vector3d(x + 0.5, y + 0.5, 1);
      const double across = (pinhole.pose.position + ray * kWall / -ray.z()).x();
      const double period = across / 0.35 - std::floor(across / 0.35);
      const float depth = depths.maps[4].at(x, y);
      if (depth < 0 || std::abs(across) > 0.4 || period < 0.45 || period > 0.8) continue;
      ++between;
      found += depth < (1 / kWall + 1 / kBack) / 2 ? 1 : 0;
    }
  }
  EXPECT_GT(between, 100);
  EXPECT_GT(found, 0.8 * between);
}

// Cameras without a region serve as pictures to match with.
TEST_F(CameraDepthsTest, OfRegionsAgreeWithTheReference) {
  record(3, 3, 56, 42, kBarrel);
  options_.regions.resize(9);
  options_.regions[0] = {0, 0, 40, 33};
  options_.regions[1] = {8, 3, 48, 41};
  options_.regions[4] = {16, 0, 57, 40};
  options_.regions[5] = {0, 8, 30, 43};
  expect_reference();
  const CameraDepths parts = estimate_camera_depths(instant_, options_, kPlenty);
  EXPECT_TRUE(parts.maps[8].values.empty());
  EXPECT_EQ(parts.maps[1].width, 40);
  EXPECT_EQ(parts.maps[1].height, 38);
}

// A part of a picture has the depths of the whole one, but for what its borders hide from view.
class CameraDepthsOfRegions : public CameraDepthsTest,
                              public ::testing::WithParamInterface<schemas::Distortion> {};

TEST_P(CameraDepthsOfRegions, AreThoseOfWholePictures) {
  record(3, 3, 120, 90, GetParam());
  const CameraDepths whole = estimate_camera_depths(instant_, options_, kPlenty);
  constexpr PixelRectangle kPart{30, 20, 110, 80};
  options_.regions.assign(9, kPart);
  const CameraDepths parts = estimate_camera_depths(instant_, options_, kPlenty);
  EXPECT_EQ(parts.inverse_depth_per_pixel, whole.inverse_depth_per_pixel);
  int all = 0, differ = 0;
  constexpr int kBorder = 8;
  for (int y = kPart.top + kBorder; y < kPart.bottom - kBorder; ++y) {
    for (int x = kPart.left + kBorder; x < kPart.right - kBorder; ++x) {
      const float expected = whole.maps[4].at(x, y),
                  found = parts.maps[4].at(x - kPart.left, y - kPart.top);
      ++all;
      differ += std::abs(found - expected) > 0.5 * whole.inverse_depth_per_pixel ? 1 : 0;
    }
  }
  EXPECT_LT(differ, all / 50) << "of " << all;
}

INSTANTIATE_TEST_SUITE_P(Lenses, CameraDepthsOfRegions,
                         ::testing::Values(kBarrel, schemas::Distortion{}));

TEST_F(CameraDepthsTest, WhatAFrameDoesNotShowIsNoEvidence) {
  record(3, 3, 96, 72, {-0.25, 0.05, 0, 0, 0});
  const CameraDepths depths = estimate_camera_depths(instant_, options_, kPlenty);
  int beside = 0, at_border = 0, wrong = 0;
  for (std::size_t camera = 0; camera < depths.maps.size(); ++camera) {
    const VirtualCamera& pinhole = depths.pinholes[camera];
    const schemas::Intrinsics& k = pinhole.intrinsics;
    const rig::CameraModel& model = take_->rig().cameras[camera].model;
    const Eigen::Matrix3d ray_from_pixel = world_ray_from_pixel(pinhole);
    ASSERT_GT(pinhole.width, model.width());
    for (int y = 0; y < pinhole.height; ++y) {
      for (int x = 0; x < pinhole.width; ++x) {
        const auto p = model.pixel_from_ideal({(x + 0.5 - k.cx) / k.fx, (y + 0.5 - k.cy) / k.fy});
        const double inside =
            !p ? -1 : std::min({p->x(), p->y(), model.width() - p->x(), model.height() - p->y()});
        const float found = depths.maps[camera].at(x, y);
        if (inside < 0) {
          ASSERT_EQ(found, kUnknownDepth) << x << ", " << y;
          ++beside;
        }
        if (inside < 2 || inside > 5) continue;
        const Vector3d ray = ray_from_pixel * Vector3d(x + 0.5, y + 0.5, 1);
        const double truth = 1 / depth_along(pinhole.pose.position, ray);
        ++at_border;
        wrong +=
            std::abs(static_cast<double>(found) - truth) > depths.inverse_depth_per_pixel ? 1 : 0;
      }
    }
  }
  EXPECT_GT(beside, 1000);
  EXPECT_LT(wrong, at_border / 100);
}

/// Returns a grid of 3 x 3 cameras 60 mm apart, of which the first `pairs` have another one 0.3 mm
/// beside them.
rig::Rig grid_with_pairs(std::size_t pairs) {
  rig::Rig rig;
  std::vector<schemas::CameraGeometry> cameras = testing::camera_grid(3, 3, 0.06, 640, 480, {});
  for (std::size_t i = 0; i < pairs; ++i) {
    cameras.push_back(cameras[i]);
    cameras.back().world_from_camera[i % 2 == 0 ? 3 : 7] += 0.0003;
  }
  for (const schemas::CameraGeometry& camera : cameras) {
    rig.cameras.push_back({camera.id,
                           rig::CameraModel(camera),
                           rig::pose_from_matrix(camera.world_from_camera),
                           {},
                           {},
                           {}});
  }
  return rig;
}

TEST(InitialSweep, CamerasNextToEachOtherKeepPlanesAndTolerance) {
  DepthEstimationOptions options;
  options.scene = {2, 8};
  std::vector<InitialSweepPlanes> alone;
  double per_pixel = 0;
  for (const std::size_t pairs : {0, 1, 5, 9}) {
    const rig::Rig rig = grid_with_pairs(pairs);
    LightFieldFrame instant;
    instant.rig = &rig;
    instant.frame_of_camera.assign(rig.cameras.size(), 0);
    const CameraDepths depths = camera_depths_without_maps(instant, options);
    for (int camera = 0; camera < static_cast<int>(rig.cameras.size()); ++camera) {
      const InitialSweepPlanes planes = initial_sweep_planes(depths, instant, camera, options);
      if (pairs == 0) alone.push_back(planes);
      // Neighbours are up to 0.3 mm nearer or farther.
      EXPECT_NEAR(planes.count, alone[static_cast<std::size_t>(camera) % 9].count, 1)
          << pairs << " pairs, camera " << camera;
    }
    if (pairs == 0) per_pixel = depths.inverse_depth_per_pixel;
    EXPECT_NEAR(depths.inverse_depth_per_pixel, per_pixel, 0.01 * per_pixel) << pairs << " pairs";
  }
  EXPECT_GT(alone[0].count, 20);
}

// Nothing else than the other one of its pair shows what such a camera sees.
TEST(InitialSweep, APairThatLooksElsewhereIsMatchedWithItself) {
  rig::Rig rig = grid_with_pairs(1);
  const Eigen::AngleAxisd back(3, Vector3d::UnitY());
  for (const std::size_t camera : {0, 9}) {
    rig.cameras[camera].pose.world_from_camera_rotation = back.toRotationMatrix();
  }
  LightFieldFrame instant;
  instant.rig = &rig;
  instant.frame_of_camera.assign(rig.cameras.size(), 0);
  DepthEstimationOptions options;
  options.scene = {2, 8};
  const CameraDepths depths = camera_depths_without_maps(instant, options);
  EXPECT_EQ(depth_neighbours(depths, instant, 0, {1.0 / 8, 1.0 / 2}, 8), (std::vector<int>{9}));
  EXPECT_GT(depths.inverse_depth_per_pixel, 0);
}

TEST_F(CameraDepthsTest, SameInGroupsOfAnySizeAndInLittleMemory) {
  record(4, 4, 56, 42, kBarrel);
  options_.support_views = 5;
  options_.neighbours = 4;
  const CameraDepths expected = estimate_camera_depths(instant_, options_, kPlenty);
  std::size_t fitting = 0;
  for (std::size_t bytes = 100'000; bytes < 6'000'000; bytes = bytes * 5 / 4) {
    try {
      const CameraDepths found = estimate_camera_depths(instant_, options_, bytes);
      for (std::size_t i = 0; i < found.maps.size(); ++i) {
        ASSERT_EQ(found.maps[i].values, expected.maps[i].values) << bytes << " bytes, camera " << i;
      }
      ++fitting;
    } catch (const Error& error) {
      EXPECT_EQ(fitting, 0U) << "more memory, yet not enough";
      EXPECT_NE(std::string(error.what()).find("memory"), std::string::npos);
    }
  }
  EXPECT_GT(fitting, 6U);
  EXPECT_THROW(estimate_camera_depths(instant_, options_, 0), Error);
}

}  // namespace
}  // namespace raystage::render
