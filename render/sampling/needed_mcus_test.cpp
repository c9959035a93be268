// SPDX-License-Identifier: Apache-2.0
#include "render/sampling/needed_mcus.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <limits>
#include <random>

namespace raystage::render::needed_mcus_test {
namespace {

constexpr int kWidth = 320, kHeight = 240, kMcu = 16;

/// Returns a camera that a view sees rotated, tilted and scaled at random, with or without lens
/// distortion.
enum class Lens { kStraight, kDistorted, kFisheye };

SourceView random_camera(std::mt19937& random, Lens lens) {
  const auto uniform = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  };
  Eigen::Matrix3d matrix = Eigen::Matrix3d::Zero();
  const double angle = uniform(-3, 3), scale = std::exp(uniform(-2, 2)) / 250;
  matrix.block<2, 2>(0, 0) << std::cos(angle), -std::sin(angle), std::sin(angle), std::cos(angle);
  matrix.block<2, 2>(0, 0) *= scale;
  matrix.row(2) << uniform(-2e-3, 2e-3), uniform(-2e-3, 2e-3), 1;
  const Eigen::Vector3d middle = matrix * Eigen::Vector3d(64, 48, 0);
  matrix.block<2, 1>(0, 2) << uniform(-0.3, 0.3) - middle.x(), uniform(-0.3, 0.3) - middle.y();
  schemas::CameraGeometry geometry;
  geometry.width = kWidth;
  geometry.height = kHeight;
  geometry.intrinsics = {250, 250, 160, 120, {}};
  if (lens == Lens::kDistorted) {
    geometry.intrinsics.distortion = {uniform(-0.3, 0.3), uniform(-0.05, 0.05),
                                      uniform(-0.01, 0.01), uniform(-0.01, 0.01), 0};
  }
  if (lens == Lens::kFisheye) {
    // Also turned so that a part of the view is behind it.
    geometry.intrinsics = {70,
                           71,
                           160,
                           120,
                           {},
                           schemas::Projection::kFtheta,
                           {uniform(-0.05, 0.05), 0, 0, 0},
                           uniform(1, 2)};
    matrix = Eigen::AngleAxisd(uniform(-2, 2), Eigen::Vector3d(0.2, 1, 0).normalized()) * matrix;
  }
  SourceView camera = make_source_view(rig::CameraModel(geometry), matrix);
  camera.mcus_per_row = kWidth / kMcu;
  camera.mcu_width_log2 = camera.mcu_height_log2 = 4;
  camera.chroma_radius = 1;
  return camera;
}

TEST(NeededMcus, BlocksNeedAllThatTheirPixelsReadAndLittleMore) {
  std::mt19937 random(7);
  std::size_t exact_total = 0, block_total = 0;
  for (int i = 0; i < 600; ++i) {
    SourceView camera = random_camera(random, static_cast<Lens>(i % 3));
    constexpr int kX = 128, kY = 8, kMcus = kWidth / kMcu * (kHeight / kMcu);
    std::vector<std::uint8_t> by_block(kMcus), by_tap(kMcus);
    const int y = static_cast<int>(random() % 90);
    camera.wanted_mcus = by_block.data();
    mark_block(camera, {0, kX, y, y + kY});
    camera.wanted_mcus = by_tap.data();
    for (int row = y; row < y + kY; ++row) {
      PixelRun run;
      run.end = kX;
      run.y = row;
      run.count = 1;
      run.source[0] = &camera;
      run.share[0] = run.total = {0, 0, 1};
      run.at_infinity = true;
      mark_run(run);
    }
    for (int m = 0; m < kMcus; ++m) {
      ASSERT_GE(by_block[m], by_tap[m]) << "camera " << i << " MCU " << m;
    }
    exact_total += static_cast<std::size_t>(std::ranges::count(by_tap, 1));
    block_total += static_cast<std::size_t>(std::ranges::count(by_block, 1));
  }
  EXPECT_GT(exact_total, 5000U);
  EXPECT_LT(static_cast<double>(block_total), 1.3 * static_cast<double>(exact_total));
}

TEST(NeededMcus, NothingIsNeededOfACameraThatSeesNothing) {
  std::mt19937 random(7);
  SourceView camera = random_camera(random, Lens::kStraight);
  std::vector<std::uint8_t> mcus(kWidth / kMcu * (kHeight / kMcu));
  camera.wanted_mcus = mcus.data();
  for (double& w : camera.ideal_from_pixel) w = -w;  // behind it
  mark_block(camera, {0, 128, 0, 8});
  EXPECT_EQ(std::ranges::count(mcus, 1), 0);
}

}  // namespace
}  // namespace raystage::render::needed_mcus_test
