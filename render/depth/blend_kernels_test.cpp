// SPDX-License-Identifier: Apache-2.0
#include "render/depth/blend_kernels.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <utility>

#include "render/depth/estimation_kernels.h"
#include "testing/render/test_depth_kernels.h"
#include "testing/test_simd_targets.h"

namespace raystage::render {
namespace {

using testing::bilinear;
using testing::kHeight;
using testing::kWidth;
using testing::random_depths;
using testing::transfer_point;
using testing::TransferredPoint;

/// Returns the weight of a point by VisibilityRun::border.
double at_border(const TransferredPoint& p, float border, double value) {
  if (!(border > 0)) return p.inside ? value : 1;
  if (!p.inside) return 0;
  const double nearest = std::min({p.u, kWidth - p.u, p.v, kHeight - p.v});
  return value * std::min(1.0, nearest / static_cast<double>(border));
}

class BlendKernels : public testing::DepthKernelsTest {};

TEST_F(BlendKernels, SeesAsTheReference) {
  // Random depths, where most is occluded; and a plane with an occluder in front of its middle.
  InverseDepthMap plane(kWidth, kHeight);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) plane.at(x, y) = x > 20 && x < 26 ? 0.6F : 0.3F;
  }
  const InverseDepthMap of_view = random_depths(3, 0.05F, 0.6F);
  InverseDepthMap even = of_view;
  for (float& depth : even.values) depth = 0.29F;
  using Maps = std::pair<const InverseDepthMap*, const InverseDepthMap*>;
  for (const float border : {0.0F, 5.0F})
    for (const auto& [theirs, ours] : {Maps(&depths_[1], &of_view), Maps(&plane, &even)}) {
      const InverseDepthMap *its = theirs, *own = ours;  // captured below
      const InverseDepthMap nearest = block_nearest_depths(*its);
      std::vector<float> visible(kWidth);
      testing::for_each_simd_target(depth_estimation_target, [&] {
        int part = 0, all = 0;
        for (const int y : {0, 14, kHeight - 1}) {
          const std::span<const float> depths(own->values.data() + y * kWidth, kWidth);
          compute_visibility(
              {0, y, partners_[1].transfer, its, &nearest, depths, 0.1F, border, visible});
          for (int x = 0; x < kWidth; ++x) {
            const TransferredPoint p =
                transfer_point(partners_[1].transfer, x + 0.5, y + 0.5, depths[x]);
            const double seen = !p.inside ? 0 : bilinear(p.u, p.v, [&](int i, int j) {
              const double nearer = its->at(i, j) - p.inverse_depth;
              return std::clamp((kOcclusionRamp - nearer / 0.1) / (kOcclusionRamp - 1), 0.0, 1.0);
            });
            const double expected = at_border(p, border, seen);
            ASSERT_NEAR(visible[x], expected, 2e-3) << x << ", " << y;
            part += expected > 0.01 && expected < 0.99;
            all += expected > 0.99;
          }
        }
        EXPECT_GT(part, 3);
        EXPECT_GT(all, kWidth / (border > 0 ? 4 : 2));
      });
    }
}

TEST_F(BlendKernels, SharesOfSurfacesAreThoseOfTheReference) {
  InverseDepthMap theirs = random_depths(5, 0.05F, 0.6F);
  for (std::size_t i = 0; i < theirs.values.size(); i += 7) theirs.values[i] = kUnknownDepth;
  const InverseDepthMap own = random_depths(3, 0.05F, 0.6F);
  const InverseDepthMap nearest = block_nearest_depths(theirs);
  constexpr float kTolerance = 0.1F;
  testing::for_each_simd_target(depth_estimation_target, [&] {
    int part = 0, none = 0;
    for (const int y : {0, 14, kHeight - 1}) {
      for (const int first : {0, 5}) {
        const float border = first > 0 ? 6 : 0;
        const int count = kWidth - first - (first > 0 ? 9 : 0);
        const std::span<const float> depths(own.values.data() + y * kWidth + first,
                                            static_cast<std::size_t>(count));
        std::vector<float> share(static_cast<std::size_t>(count));
        compute_surface_share(
            {first, y, partners_[1].transfer, &theirs, &nearest, depths, kTolerance, border, {}},
            share);
        for (int x = 0; x < count; ++x) {
          const TransferredPoint p =
              transfer_point(partners_[1].transfer, first + x + 0.5, y + 0.5, depths[x]);
          const auto ramp = [](double excess) {
            return std::clamp((kOcclusionRamp - excess) / (kOcclusionRamp - 1), 0.0, 1.0);
          };
          const double at_surface = !p.inside ? 0 : bilinear(p.u, p.v, [&](int i, int j) {
            const auto its = static_cast<double>(theirs.at(i, j));
            const double excess = (its - p.inverse_depth) / kTolerance;
            return its < 0 ? 1.0 : ramp(excess) * ramp(-excess);
          });
          const double expected = at_border(p, border, at_surface);
          ASSERT_NEAR(share[x], expected, 2e-3) << x << ", " << y;
          part += expected > 0.01 && expected < 0.99;
          none += expected < 0.01;
        }
      }
    }
    EXPECT_GT(part, 20);
    EXPECT_GT(none, 5);
  });
}

TEST_F(BlendKernels, BlocksHoldTheNearestThatSamplesInThemMeet) {
  const InverseDepthMap map = random_depths(8, 0, 1);
  const InverseDepthMap nearest = block_nearest_depths(map);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const float block = nearest.at(x >> kVisibilityBlockLog2, y >> kVisibilityBlockLog2);
      for (int i = 0; i < 4; ++i) {
        ASSERT_GE(block, map.at(std::min(x + i % 2, kWidth - 1), std::min(y + i / 2, kHeight - 1)));
      }
    }
  }
}

TEST_F(BlendKernels, ACameraThatDiffersCountsLess) {
  constexpr std::size_t kCameras = 5;
  std::array<std::array<float, 4 * kMaxRunPixels>, kCameras> samples{};
  std::array<std::array<float, kMaxRunPixels>, kCameras> weights{}, visible{};
  std::vector<const float*> sample_of, share_of, visible_of;
  for (std::size_t i = 0; i < kCameras; ++i) {
    const float seen = i == 4 ? 0.5F * 65535 : 65535.0F;
    const float code = i == 0 ? 0.9F : 0.4F;  // the first camera sees another object
    samples[i] = {code * seen, 0.5F * seen, 0.2F * seen, seen};
    weights[i][0] = 0.2F;
    visible[i][0] = i == 3 ? 0.0F : 1.0F;
    sample_of.push_back(samples[i].data());
    share_of.push_back(weights[i].data());
    visible_of.push_back(visible[i].data());
  }
  testing::for_each_simd_target(depth_estimation_target, [&] {
    std::array<float, 4> sums{};
    blend_reweighted({sample_of, share_of, visible_of, 1, 0.04F * 65535}, sums);
    const double alpha = 0.2 * 3.5;  // one camera is occluded, and one sees half
    EXPECT_NEAR(sums[3] / 65535, alpha, 1e-4);
    EXPECT_NEAR(sums[1] / 65535 / alpha, 0.5, 1e-4);
    const double red = sums[0] / 65535 / alpha;  // the mean of cameras that see it: 0.543
    EXPECT_GT(red, 0.4);
    EXPECT_LT(red, 0.45);
    for (auto& camera : visible) camera[0] = 0;  // occluded for all cameras
    blend_reweighted({sample_of, share_of, visible_of, 1, 0.04F * 65535}, sums);
    EXPECT_EQ(sums, (std::array<float, 4>{}));
    for (std::size_t i = 0; i < kCameras; ++i) visible[i][0] = i == 3 ? 0.0F : 1.0F;
  });
  const std::array<float, 4 * kMaxRunPixels> nothing{};
  const std::vector<const float*> none{nothing.data()};
  std::array<float, 4> sums{1, 1, 1, 1};
  blend_reweighted({none, std::span(share_of).first(1), std::span(visible_of).first(1), 1, 655},
                   sums);
  EXPECT_EQ(sums, (std::array<float, 4>{}));
}

}  // namespace
}  // namespace raystage::render
