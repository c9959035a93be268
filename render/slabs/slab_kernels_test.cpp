// SPDX-License-Identifier: Apache-2.0
#include "render/slabs/slab_kernels.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "base/transfer_function.h"
#include "testing/test_simd_targets.h"

namespace raystage::render {
namespace {

constexpr int kWidth = 37, kHeight = 23;

/// Returns four random images with their padding.
std::vector<std::vector<std::uint16_t>> random_images() {
  std::mt19937 random(11);
  std::vector<std::vector<std::uint16_t>> images;
  for (int i = 0; i < 4; ++i) {
    std::vector<std::uint16_t> image((kWidth * (kHeight + 1) + 1) * 4);
    for (std::uint16_t& code : image) code = static_cast<std::uint16_t>(random() & 0xffff);
    images.push_back(std::move(image));
  }
  return images;
}

/// Returns a run that crosses the images' borders and the cell's corners.
SlabRun sweeping_run(const std::vector<std::vector<std::uint16_t>>& images) {
  SlabRun run;
  run.begin = 3;
  run.end = 150;
  run.y = 8;
  run.width = kWidth;
  run.height = kHeight;
  for (std::size_t i = 0; i < 4; ++i) run.node[i] = images[i].data();
  run.across = {0.001, 0.002, 1.3};
  run.column = {0.011, 0.01, -0.2};
  run.row = {-0.009, 0.02, 1.1};
  run.ahead = {-0.004, 0.003, 1};
  run.u = {SlabRun::LinearFunction{0.2, 0.1, -3}, SlabRun::LinearFunction{0.21, 0.08, -4}};
  run.v = {SlabRun::LinearFunction{0.02, 0.9, 1}, SlabRun::LinearFunction{0.03, 0.95, -1}};
  run.slope = {-0.01, 0.001, 1.31};
  run.distance = 2;
  return run;
}

double at(const SlabRun::LinearFunction& f, int x, int y) {
  return f[0] * (x + 0.5) + f[1] * (y + 0.5) + f[2];
}

/// One pixel in double, by the formulas of the header.
struct Pixel {
  double rgba[4] = {0, 0, 0, 0};
  double z = std::numeric_limits<double>::infinity();
};
Pixel pixel_of(const SlabRun& run, int x, store::BlendSpace space, double full_scale) {
  Pixel pixel;
  const double slope = at(run.slope, x, run.y);
  const double ahead = at(run.ahead, x, run.y);
  if ((!run.at_infinity && slope <= 0) || ahead <= 0) return pixel;
  double share[2][2];
  const double across = at(run.across, x, run.y);
  for (int axis = 0; axis < 2; ++axis) {
    double second = std::clamp(at(axis == 0 ? run.column : run.row, x, run.y) / across, 0.0, 1.0);
    if (run.interpolation == SlabInterpolation::kNearest) second = second >= 0.5 ? 1 : 0;
    share[axis][0] = 1 - second;
    share[axis][1] = second;
  }
  for (int node = 0; node < 4; ++node) {
    const int c = node % 2, r = node / 2;
    const double u = at(run.u[c], x, run.y) / ahead;
    const double v = at(run.v[r], x, run.y) / ahead;
    const double border = std::min({u, kWidth - u, v, kHeight - v});
    if (border <= 0 || run.node[node] == nullptr) continue;
    const double seen = share[0][c] * share[1][r] * std::min(1.0, 2 * std::min(u, kWidth - u)) *
                        std::min(1.0, 2 * std::min(v, kHeight - v));
    double left = std::clamp(u - 0.5, 0.0, kWidth - 1.0),
           top = std::clamp(v - 0.5, 0.0, kHeight - 1.0);
    if (run.interpolation != SlabInterpolation::kQuadrilinear) {
      left = std::floor(left + 0.5);
      top = std::floor(top + 0.5);
    }
    for (int dy = 0; dy < 2; ++dy) {
      for (int dx = 0; dx < 2; ++dx) {
        const int sx = static_cast<int>(left), sy = static_cast<int>(top);
        const double weight = (dx ? left - sx : 1 - left + sx) * (dy ? top - sy : 1 - top + sy);
        if (weight == 0) continue;
        for (int k = 0; k < 4; ++k) {
          const auto index = static_cast<std::size_t>(((sy + dy) * kWidth + sx + dx) * 4 + k);
          pixel.rgba[k] += seen * weight * run.node[node][index] / 65535.0;
        }
      }
    }
  }
  const double alpha = pixel.rgba[3];
  if (alpha > 0 && !run.at_infinity) pixel.z = run.distance / slope;
  for (int k = 0; k < 3; ++k) {
    const double code = pixel.rgba[k];
    pixel.rgba[k] = full_scale * (space == store::BlendSpace::kLinear ? code
                                  : alpha > 0 ? linear_from_srgb(code / alpha) * alpha
                                              : 0.0);
  }
  return pixel;
}

void expect_agreement(const SlabRun& run, store::BlendSpace space) {
  const auto count = static_cast<std::size_t>(run.end - run.begin);
  std::vector<float> rgba(count * 4 + 4, -7), z(count + 1, -7);
  sample_slab_run(run, space, 1.5F, rgba.data(), z.data());
  int seen = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const Pixel truth = pixel_of(run, run.begin + static_cast<int>(i), space, 1.5);
    seen += truth.rgba[3] > 0 ? 1 : 0;
    for (std::size_t k = 0; k < 4; ++k) {
      // Premultiplied codes of a pixel with low alpha are large relative to it, and so is its
      // linear light.
      ASSERT_NEAR(rgba[i * 4 + k], truth.rgba[k], 1e-3 + 2e-3 * std::abs(truth.rgba[k])) << i;
    }
    if (truth.rgba[3] > 1e-4) {
      if (std::isinf(truth.z)) {
        ASSERT_EQ(z[i], std::numeric_limits<float>::infinity());
      } else {
        ASSERT_NEAR(z[i], truth.z, 1e-4 * truth.z);
      }
    }
  }
  EXPECT_GT(seen, static_cast<int>(count) / 3);
  EXPECT_LT(seen, static_cast<int>(count));
  EXPECT_EQ(rgba[count * 4], -7);  // nothing beyond the run
  EXPECT_EQ(z[count], -7);
}

TEST(SlabKernels, EveryInstructionSetAgreesWithTheDefinition) {
  auto images = random_images();
  for (auto& image : images) {  // alpha is never less than colour, as in rectified images
    for (std::size_t i = 0; i < image.size(); i += 4) {
      image[i + 3] = *std::max_element(&image[i], &image[i] + 4);
    }
  }
  testing::for_each_simd_target(slab_kernel_target, [&] {
    for (const auto interpolation :
         {SlabInterpolation::kQuadrilinear, SlabInterpolation::kBilinearNodes,
          SlabInterpolation::kNearest}) {
      SlabRun run = sweeping_run(images);
      run.interpolation = interpolation;
      expect_agreement(run, store::BlendSpace::kPerceptual);
      expect_agreement(run, store::BlendSpace::kLinear);
      run.at_infinity = true;
      run.node[1] = nullptr;
      expect_agreement(run, store::BlendSpace::kLinear);
    }
  });
}

}  // namespace
}  // namespace raystage::render
