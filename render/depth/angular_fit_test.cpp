// SPDX-License-Identifier: Apache-2.0
#include "render/depth/angular_fit.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <random>
#include <vector>

#include "render/depth/estimation_kernels.h"
#include "testing/test_simd_targets.h"

namespace raystage::render {
namespace {

constexpr float kFull = 65535;

/// Cameras around a view and what they see at a row of pixels.
struct AngularScene {
  explicit AngularScene(std::size_t cameras, std::size_t pixels, std::uint32_t seed)
      : samples(cameras), weights(cameras), visible(cameras), depths(pixels) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<float> unit(0, 1);
    for (float& depth : depths) depth = 0.1F + 0.4F * unit(random);
    for (std::size_t c = 0; c < cameras; ++c) {
      const float ahead = 0.4F * (unit(random) - 0.5F);
      offsets.push_back(
          {3 * (unit(random) - 0.5F), 3 * (unit(random) - 0.5F), ahead / 0.1F, ahead});
      for (std::size_t x = 0; x < pixels; ++x) {
        const float seen = unit(random) < 0.1F ? 0 : 1 - 0.3F * unit(random);
        for (std::size_t i = 0; i < 3; ++i) {
          samples[c][4 * x + i] = kFull * seen * (0.2F + 0.6F * unit(random));
        }
        samples[c][4 * x + 3] = kFull * seen;
        weights[c][x] = (0.5F + unit(random)) / static_cast<float>(cameras);
        visible[c][x] = unit(random) < 0.2F ? 0.3F * unit(random) : 1;
      }
      sample_of.push_back(samples[c].data());
      weight_of.push_back(weights[c].data());
      visible_of.push_back(visible[c].data());
    }
  }
  AngularRun run() const {
    return {sample_of, weight_of, visible_of, offsets, -0.3F, 0.01F, 0.2F, depths};
  }
  std::vector<AngularSample> at(std::size_t x) const {
    std::vector<AngularSample> result;
    for (std::size_t c = 0; c < offsets.size(); ++c) {
      const double seen = samples[c][4 * x + 3];
      const double distance = 1 - double{offsets[c].ahead_m} * double{depths[x]};
      if (!(seen > 0) || !(distance > double{kMinAngularDistance})) continue;
      AngularSample& s = result.emplace_back();
      const double slope = -0.3 + 0.01 * static_cast<double>(x);
      s.x = (double{offsets[c].right} - slope * double{offsets[c].ahead}) / distance;
      s.y = (double{offsets[c].up} - 0.2 * double{offsets[c].ahead}) / distance;
      s.seen = double{visible[c][x]} * seen / double{kFull};
      s.weight = s.seen * double{weights[c][x]};
      for (std::size_t i = 0; i < 3; ++i) s.code[i] = 255 * double{samples[c][4 * x + i]} / seen;
    }
    return result;
  }

  std::vector<std::array<float, 4 * kMaxRunPixels>> samples;
  std::vector<std::array<float, kMaxRunPixels>> weights, visible;
  std::vector<float> depths;
  std::vector<AngularOffset> offsets;
  std::vector<const float*> sample_of, weight_of, visible_of;
};

TEST(AngularFit, KernelsEqualTheReference) {
  testing::for_each_simd_target(depth_estimation_target, [] {
    int valid = 0, not_valid = 0;
    for (const std::size_t cameras : {7U, 9U, 16U, 40U}) {
      for (const std::size_t pixels : {1U, 5U, 32U}) {
        const AngularScene scene(cameras, pixels, static_cast<std::uint32_t>(cameras + pixels));
        AngularFitResult result;
        fit_angular(scene.run(), result);
        for (std::size_t x = 0; x < pixels; ++x) {
          const AngularFitOfPixel expected = fit_angular_reference(scene.at(x));
          ASSERT_EQ(result.rgba[4 * x + 3], expected.is_valid ? 1.0F : 0.0F);
          (expected.is_valid ? valid : not_valid) += 1;
          for (std::size_t c = 0; c < 3; ++c) {
            ASSERT_NEAR(result.rgba[4 * x + c] / 257, expected.code[c], 0.02);
          }
          ASSERT_NEAR(result.difference[x], expected.difference, 1e-3 * (1 + expected.difference));
          ASSERT_NEAR(result.noise[x], expected.noise, 1e-3 * (1 + expected.noise));
        }
      }
    }
    EXPECT_GT(valid, 20);
    EXPECT_GT(not_valid, 20);
  });
}

/// Returns a grid of 4 x 4 cameras that see `light` of their position; near ones weigh more.
template <class Light>
std::vector<AngularSample> grid_that_sees(const Light& light) {
  std::vector<AngularSample> samples;
  for (int i = 0; i < 16; ++i) {
    const int row = i / 4;
    const double x = i % 4 - 1.4, y = row - 1.6;
    const double weight = 0.06 / (0.4 + std::hypot(x, y));
    const double code = light(x, y, weight);
    samples.push_back({x, y, weight, 1, {code, code / 2, 100}});
  }
  return samples;
}

TEST(AngularFit, FollowsLightThatDependsOnTheCamera) {
  const AngularFitOfPixel fit = fit_angular_reference(grid_that_sees(
      [](double x, double y, double) { return 90 + 9 * x - 5 * y + 4 * x * x - 3 * x * y; }));
  ASSERT_TRUE(fit.is_valid);
  EXPECT_NEAR(fit.code[0], 90, 0.2);  // the mean is about 95
  EXPECT_NEAR(fit.code[1], 45, 0.1);
  EXPECT_NEAR(fit.code[2], 100, 1e-9);
  EXPECT_GT(fit.difference, 100 * fit.noise);
}

TEST(AngularFit, FindsNoiseToBeNoise) {
  std::mt19937 random(7);
  std::normal_distribution<double> noise(0, 1);
  double difference = 0, expected = 0;
  for (int i = 0; i < 4000; ++i) {
    const AngularFitOfPixel fit = fit_angular_reference(grid_that_sees(
        [&](double, double, double weight) { return 90 + noise(random) / std::sqrt(weight); }));
    ASSERT_TRUE(fit.is_valid);
    difference += fit.difference;
    expected += fit.noise;
  }
  EXPECT_NEAR(difference / expected, 1, 0.1);  // if the variance is 1 / weight
}

TEST(AngularFit, RowsOfCamerasAreFittedAlongTheRow) {
  std::vector<AngularSample> row;
  for (int i = 0; i < 16; ++i) {
    const double x = (i - 7.3) / 5;
    row.push_back({x, 0.001 * (i % 3), 1.0 / 16, 1, {90 + 20 * x + 9 * x * x, 50, 50}});
  }
  const AngularFitOfPixel fit = fit_angular_reference(row);
  ASSERT_TRUE(fit.is_valid);
  EXPECT_NEAR(fit.code[0], 90, 0.5);
}

TEST(AngularStrengths, AreSmoothAndZeroWithoutDifferences) {
  depth::AngularStrengths strengths(150, 90);
  for (int y = 0; y < 90; ++y) {
    for (int x = 0; x < 150 && depth::AngularStrengths::is_measured(y); ++x) {
      strengths.measure(x, y, x < 60 ? 100 : 1, 1);
    }
  }
  strengths.decide();
  EXPECT_EQ(strengths.at(10, 40), 1);
  EXPECT_EQ(strengths.at(130, 40), 0);
  for (int x = 1; x < 150; ++x) {
    EXPECT_LE(std::abs(strengths.at(x, 40) - strengths.at(x - 1, 40)),
              1.01F / depth::AngularStrengths::kCell);
  }
}

}  // namespace
}  // namespace raystage::render
