// SPDX-License-Identifier: Apache-2.0
// Tests of the kernels of depth estimation.
#include "render/depth/estimation_kernels.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <random>

#include "testing/render/test_depth_kernels.h"
#include "testing/test_simd_targets.h"

namespace raystage::render {
namespace {

using testing::bilinear;
using testing::is_known;
using testing::kHeight;
using testing::kWidth;
using testing::luma_at;
using testing::random_depths;
using testing::transfer_point;
using testing::TransferredPoint;

class DepthKernels : public testing::DepthKernelsTest {};

TEST_F(DepthKernels, MatchesAsTheReference) {
  constexpr int kPlanes = 5, kStride = 32;
  std::vector<std::uint8_t> costs(kWidth * kStride), is_seen(kWidth);
  testing::for_each_simd_target(depth_estimation_target, [&] {
    int unknown = 0, told = 0;
    for (const int y : {0, 14, kHeight - 1}) {
      match_row(
          {y, &image_, partners_, 0.1, 0.5, kPlanes, kStride, 40, costs.data(), is_seen.data()});
      for (int x = 0; x < kWidth; ++x) {
        bool ever = false, decided = true;
        for (int plane = 0; plane < kPlanes; ++plane) {
          std::vector<double> off;
          for (const NeighbourView& partner : partners_) {
            const TransferredPoint p =
                transfer_point(partner.transfer, x + 0.5, y + 0.5, 0.1 + 0.5 * plane);
            const std::optional<bool> seen = is_known(*partner.image, p);
            decided = decided && seen;
            if (!seen || !*seen || !image_.is_known(x, y)) continue;
            off.push_back(
                std::min(40.0, std::abs(luma_at(*partner.image, p.u, p.v) - image_.luma(x, y))));
          }
          if (!decided) break;
          std::ranges::sort(off);
          off.resize((off.size() + 1) / 2);
          double expected = matching::kUnknownCost;
          if (!off.empty()) {
            expected = 0;
            for (const double value : off)
              expected += value * 255 / 40 / static_cast<double>(off.size());
          }
          ASSERT_NEAR(costs[x * kStride + plane], expected, 0.7)
              << x << ", " << y << " plane " << plane;
          off.empty() ? ++unknown : ++told;
          ever = ever || !off.empty();
        }
        if (!decided) continue;
        ASSERT_EQ(is_seen[x], ever ? 1 : 0) << x << ", " << y;
      }
    }
    EXPECT_GT(told, 300);
    EXPECT_GT(unknown, kPlanes);
  });
}

TEST_F(DepthKernels, AnImageKnowsWhatItsFrameShows) {
  const schemas::CameraGeometry bent = [&] {
    schemas::CameraGeometry geometry;
    geometry.id = "c";
    geometry.width = kWidth;
    geometry.height = kHeight;
    geometry.intrinsics = own_.intrinsics;
    geometry.intrinsics.distortion.k1 = 0.5;
    return geometry;
  }();
  const rig::CameraModel model(bent);
  const schemas::Intrinsics& k = own_.intrinsics;
  int unknown = 0;
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      bool is_shown = true;
      for (int i = 0; i < 4; ++i) {  // the four pixels of a bilinear sample that starts here
        const int column = std::min(x + i % 2, kWidth - 1), row = std::min(y + i / 2, kHeight - 1);
        const auto p =
            model.pixel_from_ideal({(column + 0.5 - k.cx) / k.fx, (row + 0.5 - k.cy) / k.fy});
        is_shown = is_shown && p && p->minCoeff() >= 0 && p->x() <= kWidth && p->y() <= kHeight;
      }
      ASSERT_EQ(image_.is_known(x, y), is_shown) << x << ", " << y;
      unknown += is_shown ? 0 : 1;
    }
  }
  EXPECT_GT(unknown, 20);
  EXPECT_LT(unknown, kWidth * kHeight / 4);
}

TEST_F(DepthKernels, RefinesAsTheReference) {
  const InverseDepthMap present = random_depths(7, 0.15F, 0.45F);
  std::vector<float> costs(kWidth * kRefineOffsetStride, -1.0F);
  testing::for_each_simd_target(depth_estimation_target, [&] {
    int seen_by_some = 0, hidden = 0, left_out = 0;
    for (const int y : {0, 14, kHeight - 1}) {
      const float* row = present.values.data() + y * kWidth;
      refine_row({y, &image_, partners_, row, 0.01, 0.05F, 15, costs.data()});
      for (int x = 0; x < kWidth; ++x) {
        std::array<double, kRefineOffsetStride> sums{};
        int count = 0;
        bool decided = true;
        for (std::size_t i = 0; i < kPartners; ++i) {
          const TransferredPoint p =
              transfer_point(partners_[i].transfer, x + 0.5, y + 0.5, row[x]);
          if (!p.inside) continue;
          const float its = depths_[i].at(std::min(static_cast<int>(p.u), kWidth - 1),
                                          std::min(static_cast<int>(p.v), kHeight - 1));
          if (its > p.inverse_depth + 0.05) {
            ++hidden;
            continue;
          }
          bool is_shown = image_.is_known(x, y);
          std::array<double, kRefineOffsets> tried{};
          for (int c = 0; c < kRefineOffsets; ++c) {
            const TransferredPoint moved =
                transfer_point(partners_[i].transfer, x + 0.5, y + 0.5,
                               static_cast<double>(row[x]) + (c - 3) * 0.01);
            const std::optional<bool> seen = is_known(images_[i], moved);
            decided = decided && seen;
            is_shown = is_shown && seen && *seen;
            if (!is_shown) break;
            const double off = luma_at(images_[i], moved.u, moved.v) - image_.luma(x, y);
            tried[c] = off * off / (1 + off * off / 225);
          }
          if (!is_shown) {
            ++left_out;
            continue;
          }
          ++count;
          for (std::size_t c = 0; c < kRefineOffsets; ++c) sums[c] += tried[c];
        }
        if (!decided) continue;
        seen_by_some += count > 0;
        for (int c = 0; c < kRefineOffsetStride; ++c) {
          ASSERT_NEAR(costs[x * kRefineOffsetStride + c], sums[c] / std::max(1, count), 0.2)
              << x << ", " << y << " offset " << c;
        }
      }
    }
    EXPECT_GT(seen_by_some, kWidth);
    EXPECT_GT(hidden, kWidth);
    EXPECT_GT(left_out, kWidth);
  });
}

TEST_F(DepthKernels, VotesAsTheReference) {
  constexpr std::size_t kReports = 7, kPixels = 29;
  std::mt19937 random(3);
  std::uniform_real_distribution<float> unit(0, 1);
  std::array<std::array<float, kMaxVotePixels>, kReports> hypotheses{}, weights{};
  std::vector<const float*> report_of, weight_of;
  for (std::size_t i = 0; i < kReports; ++i) {
    for (std::size_t x = 0; x < kMaxVotePixels; ++x) {
      hypotheses[i][x] = random() % 9 == 0 ? kUnknownDepth : unit(random);
      weights[i][x] = random() % 9 == 0 ? 0 : unit(random);
    }
    report_of.push_back(hypotheses[i].data());
    weight_of.push_back(weights[i].data());
  }
  std::array<float, kMaxVotePixels> depth{}, share{};
  testing::for_each_simd_target(depth_estimation_target, [&] {
    vote({report_of, weight_of, kPixels, 0.2F, depth.data(), share.data()});
    for (std::size_t x = 0; x < kPixels; ++x) {
      double all = 0, best = 0, mean = kUnknownDepth;
      float chosen = kUnknownDepth;
      for (std::size_t i = 0; i < kReports; ++i) {
        if (hypotheses[i][x] < 0 || weights[i][x] == 0) continue;
        all += static_cast<double>(weights[i][x]);
        double support = 0, sum = 0;
        for (std::size_t j = 0; j < kReports; ++j) {
          if (hypotheses[j][x] < 0) continue;
          const double off = std::abs(static_cast<double>(hypotheses[j][x]) -
                                      static_cast<double>(hypotheses[i][x]));
          const double weight = static_cast<double>(weights[j][x]) * std::max(0.0, 1 - off / 0.2);
          support += weight;
          sum += weight * static_cast<double>(hypotheses[j][x]);
        }
        const bool as_good = support > 0.9999 * best && hypotheses[i][x] > chosen;
        if (support > 1.0001 * best || as_good) {
          best = support;
          chosen = hypotheses[i][x];
          mean = sum / support;
        }
      }
      ASSERT_NEAR(depth[x], mean, 1e-5) << x;
      ASSERT_NEAR(share[x], all > 0 ? best / all : 0, 1e-5) << x;
    }
  });
}

TEST_F(DepthKernels, OfEqualReportsTheNearerWins) {
  const std::vector<float> far(kMaxVotePixels, 0.2F), near(kMaxVotePixels, 0.7F),
      none(kMaxVotePixels, kUnknownDepth), half(kMaxVotePixels, 0.5F);
  std::array<float, kMaxVotePixels> depth{}, share{};
  const std::vector<const float*> weights{half.data(), half.data(), near.data()};
  for (const auto& rows : {std::vector{far.data(), near.data(), none.data()},
                           std::vector{near.data(), far.data(), none.data()}}) {
    vote({rows, weights, kMaxVotePixels, 0.1F, depth.data(), share.data()});
    EXPECT_FLOAT_EQ(depth[kMaxVotePixels / 2], 0.7F);
    EXPECT_FLOAT_EQ(share[kMaxVotePixels / 2], 0.5F);
  }
  const std::vector<const float*> nobody{none.data()};
  vote({nobody, std::span(weights).first(1), kMaxVotePixels, 0.1F, depth.data(), share.data()});
  EXPECT_EQ(depth[0], kUnknownDepth);
  EXPECT_EQ(share[0], 0);
}

TEST_F(DepthKernels, TakesMediansAsTheReference) {
  constexpr float kNoLines = std::numeric_limits<float>::infinity();
  const InverseDepthMap map = random_depths(4, 0, 1);
  constexpr float kLine = 0.15F;
  std::vector<float> medians(kWidth), with_lines(kWidth);
  int lines = 0;
  testing::for_each_simd_target(depth_estimation_target, [&] {
    for (const int y : {0, 14, kHeight - 1}) {
      const auto row = [&](int at) {
        return map.values.data() +
               static_cast<std::ptrdiff_t>(std::clamp(at, 0, kHeight - 1)) * kWidth;
      };
      median_row({row(y - 1), row(y), row(y + 1)}, kNoLines, medians);
      median_row({row(y - 1), row(y), row(y + 1)}, kLine, with_lines);
      for (int x = 0; x < kWidth; ++x) {
        std::vector<float> all;
        for (int i = 0; i < 9; ++i) {
          all.push_back(map.at(std::clamp(x + i % 3 - 1, 0, kWidth - 1),
                               std::clamp(y + i / 3 - 1, 0, kHeight - 1)));
        }
        const float own = all[4];
        const auto like = [&](int i) { return std::abs(all[i] - own) <= kLine; };
        bool line = false;
        for (int i = 0; i < 4; ++i) line = line || (like(i) && like(8 - i));
        std::ranges::sort(all);
        line = line && own - all[4] > kLine;
        lines += line ? 1 : 0;
        const auto at = static_cast<std::size_t>(x);
        ASSERT_EQ(medians[at], all[4]) << x << ", " << y;
        ASSERT_EQ(with_lines[at], line ? own : all[4]) << x << ", " << y;
      }
    }
    std::vector<float> narrow{0.5F};
    const float above = 1, below = 2;
    median_row({&above, narrow.data(), &below}, kNoLines, narrow);
    EXPECT_EQ(narrow[0], 1);
  });
  EXPECT_GT(lines, 0);
}

}  // namespace
}  // namespace raystage::render
