// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <optional>
#include <random>

#include "render/depth/blend_kernels.h"
#include "render/depth/solve_kernels.h"
#include "schemas/test_targets.h"

namespace raystage {
namespace {

constexpr int kWidth = 53, kHeight = 31;

VirtualCamera camera_at(const Eigen::Vector3d& position, double yaw) {
  Pose pose;
  pose.position = position;
  pose.world_from_camera_rotation =
      Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitY()).toRotationMatrix();
  return virtual_camera_with_fov(kWidth, kHeight, 0.8, pose);
}

/// `bend` (k1 of the lens) above 0: the frame shows less than the pinhole's corners.
MatchingImage random_image(unsigned seed, const VirtualCamera& pinhole, double bend) {
  DecodedFrame frame;
  frame.width = pinhole.width;
  frame.height = pinhole.height;
  const auto pixels = static_cast<std::size_t>(frame.width * frame.height);
  frame.rgbx = std::make_unique<std::uint16_t[]>(4 * pixels);
  std::mt19937 random(seed);
  for (std::size_t i = 0; i < 4 * pixels; ++i) {
    frame.rgbx[i] = static_cast<std::uint16_t>(random());
  }
  CameraGeometry geometry;
  geometry.id = "c";
  geometry.width = pinhole.width;
  geometry.height = pinhole.height;
  geometry.intrinsics = pinhole.intrinsics;
  geometry.intrinsics.distortion.k1 = bend;
  return {frame,
          BlendSpace::kPerceptual,
          {"c", CameraModel(geometry), pinhole.pose, {}, {}, {}},
          pinhole};
}

InverseDepthMap random_depths(unsigned seed, float least, float most) {
  InverseDepthMap map{kWidth, kHeight, {}};
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> depth(least, most);
  for (int i = 0; i < kWidth * kHeight; ++i) {
    map.values.push_back(random() % 9 == 0 ? kUnknownDepth : depth(random));
  }
  return map;
}

struct Place {
  double u = 0, v = 0, w = 0, inverse_depth = 0;
  bool inside = false;
};
Place place_of(const PixelTransfer& t, double x, double y, double q) {
  const auto part = [&](std::size_t r) {
    return t.direction[3 * r] * x + t.direction[3 * r + 1] * y + t.direction[3 * r + 2] +
           q * t.parallax[r];
  };
  const double w = part(2);
  Place place{part(0) / w, part(1) / w, w, q / w, false};
  place.inside = w > 0 && place.u >= 0 && place.v >= 0 && place.u <= kWidth && place.v <= kHeight;
  return place;
}

double bilinear(double u, double v, const std::function<double(int, int)>& at) {
  const double x = std::clamp(u - 0.5, 0.0, kWidth - 1.0);
  const double y = std::clamp(v - 0.5, 0.0, kHeight - 1.0);
  const int x0 = static_cast<int>(x), y0 = static_cast<int>(y);
  const int x1 = std::min(x0 + 1, kWidth - 1), y1 = std::min(y0 + 1, kHeight - 1);
  const double right = x - x0, down = y - y0;
  return (1 - down) * ((1 - right) * at(x0, y0) + right * at(x1, y0)) +
         down * ((1 - right) * at(x0, y1) + right * at(x1, y1));
}
double luma_at(const MatchingImage& image, double u, double v) {
  const int left = static_cast<int>(std::clamp(u - 0.5, 0.0, kWidth - 1.0));
  const int top = static_cast<int>(std::clamp(v - 0.5, 0.0, kHeight - 1.0));
  const std::uint32_t word = image.words()[top * kWidth + left];
  return bilinear(u, v, [&](int x, int y) {
    return static_cast<double>(word >> (8 * (x - left) + 16 * (y - top)) & 0xFFU);
  });
}
/// Whether an image knows what it shows at a position; nothing where rounding decides.
std::optional<bool> is_known(const MatchingImage& image, const Place& place) {
  int known = 0;
  for (int i = 0; i < 4; ++i) {
    const double u = place.u + (i % 2 == 0 ? -1e-3 : 1e-3), v = place.v + (i < 2 ? -1e-3 : 1e-3);
    const bool is_inside = place.w > 0 && u >= 0 && v >= 0 && u <= kWidth && v <= kHeight;
    known += is_inside && image.is_known(static_cast<int>(std::clamp(u - 0.5, 0.0, kWidth - 1.0)),
                                         static_cast<int>(std::clamp(v - 0.5, 0.0, kHeight - 1.0)));
  }
  if (known % 4 != 0) return std::nullopt;
  return known == 4;
}

class DepthKernels : public ::testing::Test {
 protected:
  DepthKernels() {
    for (std::size_t i = 0; i < kPartners; ++i) {
      const auto n = static_cast<double>(i);
      others_.push_back(camera_at({0.1 * n - 0.25, 0.03 * n - 0.1, 0.01 * n}, 0.02 * n - 0.05));
      images_.push_back(random_image(static_cast<unsigned>(i) + 1, others_.back(), 0.3 * n));
      depths_.push_back(random_depths(static_cast<unsigned>(i) + 20, 0.1F, 0.5F));
    }
    for (std::size_t i = 0; i < kPartners; ++i) {
      partners_.push_back({pixel_transfer(others_[i], own_), &images_[i], &depths_[i]});
    }
  }
  static constexpr std::size_t kPartners = 6;
  VirtualCamera own_ = camera_at({0, 0, 0}, 0);
  MatchingImage image_ = random_image(0, own_, 0.5);
  std::vector<VirtualCamera> others_;
  std::vector<MatchingImage> images_;
  std::vector<InverseDepthMap> depths_;
  std::vector<Partner> partners_;
};

TEST_F(DepthKernels, MatchesAsTheReference) {
  constexpr int kPlanes = 5, kStride = 32;
  std::vector<std::uint8_t> costs(kWidth * kStride), is_seen(kWidth);
  testing::for_each_target(depth_solve_target, [&] {
    int unknown = 0, told = 0;
    for (const int y : {0, 14, kHeight - 1}) {
      match_row(
          {y, &image_, partners_, 0.1, 0.5, kPlanes, kStride, 40, costs.data(), is_seen.data()});
      for (int x = 0; x < kWidth; ++x) {
        bool ever = false, decided = true;
        for (int plane = 0; plane < kPlanes; ++plane) {
          std::vector<double> off;
          for (const Partner& partner : partners_) {
            const Place p = place_of(partner.transfer, x + 0.5, y + 0.5, 0.1 + 0.5 * plane);
            const std::optional<bool> seen = is_known(*partner.image, p);
            decided = decided && seen;
            if (!seen || !*seen || !image_.is_known(x, y)) continue;
            off.push_back(
                std::min(40.0, std::abs(luma_at(*partner.image, p.u, p.v) - image_.luma(x, y))));
          }
          if (!decided) break;
          std::ranges::sort(off);
          off.resize((off.size() + 1) / 2);
          double expected = kUnknownCost;
          if (!off.empty()) {
            expected = 0;
            for (const double value : off)
              expected += value * 255 / 40 / static_cast<double>(off.size());
          }
          ASSERT_NEAR(costs[static_cast<std::size_t>(x * kStride + plane)], expected, 0.7)
              << x << ", " << y << " plane " << plane;
          off.empty() ? ++unknown : ++told;
          ever = ever || !off.empty();
        }
        if (!decided) continue;
        ASSERT_EQ(is_seen[static_cast<std::size_t>(x)], ever ? 1 : 0) << x << ", " << y;
      }
    }
    EXPECT_GT(told, 300);
    EXPECT_GT(unknown, kPlanes);
  });
}

TEST_F(DepthKernels, AnImageKnowsWhatItsFrameShows) {
  const CameraGeometry bent = [&] {
    CameraGeometry geometry;
    geometry.id = "c";
    geometry.width = kWidth;
    geometry.height = kHeight;
    geometry.intrinsics = own_.intrinsics;
    geometry.intrinsics.distortion.k1 = 0.5;
    return geometry;
  }();
  const CameraModel model(bent);
  const Intrinsics& k = own_.intrinsics;
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
  std::vector<float> costs(kWidth * kOffsetStride, -1.0F);
  testing::for_each_target(depth_solve_target, [&] {
    int seen_by_some = 0, hidden = 0, left_out = 0;
    for (const int y : {0, 14, kHeight - 1}) {
      const float* row = present.values.data() + y * kWidth;
      refine_row({y, &image_, partners_, row, 0.01, 0.05F, 15, costs.data()});
      for (int x = 0; x < kWidth; ++x) {
        std::array<double, kOffsetStride> sums{};
        int count = 0;
        bool decided = true;
        for (std::size_t i = 0; i < kPartners; ++i) {
          const Place p = place_of(partners_[i].transfer, x + 0.5, y + 0.5, row[x]);
          if (!p.inside) continue;
          const float its = depths_[i].at(std::min(static_cast<int>(p.u), kWidth - 1),
                                          std::min(static_cast<int>(p.v), kHeight - 1));
          if (its > p.inverse_depth + 0.05) {
            ++hidden;
            continue;
          }
          bool is_shown = image_.is_known(x, y);
          std::array<double, kOffsets> tried{};
          for (int c = 0; c < kOffsets; ++c) {
            const Place moved = place_of(partners_[i].transfer, x + 0.5, y + 0.5,
                                         static_cast<double>(row[x]) + (c - 3) * 0.01);
            const std::optional<bool> seen = is_known(images_[i], moved);
            decided = decided && seen;
            is_shown = is_shown && seen && *seen;
            if (!is_shown) break;
            const double off = luma_at(images_[i], moved.u, moved.v) - image_.luma(x, y);
            tried[static_cast<std::size_t>(c)] = off * off / (1 + off * off / 225);
          }
          if (!is_shown) {
            ++left_out;
            continue;
          }
          ++count;
          for (std::size_t c = 0; c < kOffsets; ++c) sums[c] += tried[c];
        }
        if (!decided) continue;
        seen_by_some += count > 0;
        for (int c = 0; c < kOffsetStride; ++c) {
          ASSERT_NEAR(costs[static_cast<std::size_t>(x * kOffsetStride + c)],
                      sums[static_cast<std::size_t>(c)] / std::max(1, count), 0.2)
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
  std::array<std::array<float, kMostVotes>, kReports> reports{}, weights{};
  std::vector<const float*> report_of, weight_of;
  for (std::size_t i = 0; i < kReports; ++i) {
    for (std::size_t x = 0; x < kMostVotes; ++x) {
      reports[i][x] = random() % 9 == 0 ? kUnknownDepth : unit(random);
      weights[i][x] = random() % 9 == 0 ? 0 : unit(random);
    }
    report_of.push_back(reports[i].data());
    weight_of.push_back(weights[i].data());
  }
  std::array<float, kMostVotes> depth{}, share{};
  testing::for_each_target(depth_solve_target, [&] {
    vote({report_of, weight_of, kPixels, 0.2F, depth.data(), share.data()});
    for (std::size_t x = 0; x < kPixels; ++x) {
      double all = 0, best = 0, mean = kUnknownDepth;
      float chosen = kUnknownDepth;
      for (std::size_t i = 0; i < kReports; ++i) {
        if (reports[i][x] < 0 || weights[i][x] == 0) continue;
        all += static_cast<double>(weights[i][x]);
        double support = 0, sum = 0;
        for (std::size_t j = 0; j < kReports; ++j) {
          if (reports[j][x] < 0) continue;
          const double off =
              std::abs(static_cast<double>(reports[j][x]) - static_cast<double>(reports[i][x]));
          const double weight = static_cast<double>(weights[j][x]) * std::max(0.0, 1 - off / 0.2);
          support += weight;
          sum += weight * static_cast<double>(reports[j][x]);
        }
        const bool as_good = support > 0.9999 * best && reports[i][x] > chosen;
        if (support > 1.0001 * best || as_good) {
          best = support;
          chosen = reports[i][x];
          mean = sum / support;
        }
      }
      ASSERT_NEAR(depth[x], mean, 1e-5) << x;
      ASSERT_NEAR(share[x], all > 0 ? best / all : 0, 1e-5) << x;
    }
  });
}

TEST_F(DepthKernels, OfEqualReportsTheNearerWins) {
  const std::vector<float> far(kMostVotes, 0.2F), near(kMostVotes, 0.7F),
      none(kMostVotes, kUnknownDepth), half(kMostVotes, 0.5F);
  std::array<float, kMostVotes> depth{}, share{};
  const std::vector<const float*> weights{half.data(), half.data(), near.data()};
  for (const auto& rows : {std::vector{far.data(), near.data(), none.data()},
                           std::vector{near.data(), far.data(), none.data()}}) {
    vote({rows, weights, kMostVotes, 0.1F, depth.data(), share.data()});
    EXPECT_FLOAT_EQ(depth[kMostVotes / 2], 0.7F);
    EXPECT_FLOAT_EQ(share[kMostVotes / 2], 0.5F);
  }
  const std::vector<const float*> nobody{none.data()};
  vote({nobody, std::span(weights).first(1), kMostVotes, 0.1F, depth.data(), share.data()});
  EXPECT_EQ(depth[0], kUnknownDepth);
  EXPECT_EQ(share[0], 0);
}

TEST_F(DepthKernels, TakesMediansAsTheReference) {
  constexpr float kNoLines = std::numeric_limits<float>::infinity();
  const InverseDepthMap map = random_depths(4, 0, 1);
  constexpr float kLine = 0.15F;
  std::vector<float> medians(kWidth), with_lines(kWidth);
  int lines = 0;
  testing::for_each_target(depth_solve_target, [&] {
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
        const auto like = [&](int i) {
          return std::abs(all[static_cast<std::size_t>(i)] - own) <= kLine;
        };
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

TEST_F(DepthKernels, SeesAsTheReference) {
  // At random, where most is hidden somehow; and a plane with something in front of its middle.
  InverseDepthMap plane{kWidth, kHeight, {}};
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) plane.values.push_back(x > 20 && x < 26 ? 0.6F : 0.3F);
  }
  const InverseDepthMap of_view = random_depths(3, 0.05F, 0.6F);
  InverseDepthMap even = of_view;
  for (float& depth : even.values) depth = 0.29F;
  using Maps = std::pair<const InverseDepthMap*, const InverseDepthMap*>;
  for (const auto& [theirs, ours] : {Maps(&depths_[1], &of_view), Maps(&plane, &even)}) {
    const InverseDepthMap *its = theirs, *own = ours;  // captured below
    const InverseDepthMap nearest = nearest_of_blocks(*its);
    std::vector<float> visible(kWidth);
    testing::for_each_target(depth_solve_target, [&] {
      int part = 0, all = 0;
      for (const int y : {0, 14, kHeight - 1}) {
        const std::span<const float> depths(own->values.data() + y * kWidth, kWidth);
        find_visibility({0, y, partners_[1].transfer, its, &nearest, depths, 0.1F, visible});
        for (int x = 0; x < kWidth; ++x) {
          const Place p = place_of(partners_[1].transfer, x + 0.5, y + 0.5,
                                   depths[static_cast<std::size_t>(x)]);
          const double expected = !p.inside ? 1 : bilinear(p.u, p.v, [&](int i, int j) {
            const double nearer = its->at(i, j) - p.inverse_depth;
            return std::clamp((kHiddenBehind - nearer / 0.1) / (kHiddenBehind - 1), 0.0, 1.0);
          });
          ASSERT_NEAR(visible[static_cast<std::size_t>(x)], expected, 2e-3) << x << ", " << y;
          part += expected > 0.01 && expected < 0.99;
          all += expected > 0.99;
        }
      }
      EXPECT_GT(part, 3);
      EXPECT_GT(all, kWidth / 2);
    });
  }
}

TEST_F(DepthKernels, BlocksHoldTheNearestThatSamplesInThemMeet) {
  const InverseDepthMap map = random_depths(8, 0, 1);
  const InverseDepthMap nearest = nearest_of_blocks(map);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const float block = nearest.at(x >> kSightBlockLog2, y >> kSightBlockLog2);
      for (int i = 0; i < 4; ++i) {
        ASSERT_GE(block, map.at(std::min(x + i % 2, kWidth - 1), std::min(y + i / 2, kHeight - 1)));
      }
    }
  }
}

TEST_F(DepthKernels, ACameraThatDiffersCountsLess) {
  constexpr std::size_t kCameras = 5;
  std::array<std::array<float, 4 * kMostRun>, kCameras> samples{};
  std::array<std::array<float, kMostRun>, kCameras> shares{}, visible{};
  std::vector<const float*> sample_of, share_of, visible_of;
  for (std::size_t i = 0; i < kCameras; ++i) {
    const float seen = i == 4 ? 0.5F * 65535 : 65535.0F;
    const float code = i == 0 ? 0.9F : 0.4F;  // the first sees something else
    samples[i] = {code * seen, 0.5F * seen, 0.2F * seen, seen};
    shares[i][0] = 0.2F;
    visible[i][0] = i == 3 ? 0.0F : 1.0F;
    sample_of.push_back(samples[i].data());
    share_of.push_back(shares[i].data());
    visible_of.push_back(visible[i].data());
  }
  testing::for_each_target(depth_solve_target, [&] {
    std::array<float, 4> sums{};
    blend_agreeing({sample_of, share_of, visible_of, 1, 0.04F * 65535}, sums);
    const double alpha = 0.2 * 3.5;  // one is hidden, and one sees but half
    EXPECT_NEAR(sums[3] / 65535, alpha, 1e-4);
    EXPECT_NEAR(sums[1] / 65535 / alpha, 0.5, 1e-4);
    const double red = sums[0] / 65535 / alpha;  // the plain mean of those who see: 0.543
    EXPECT_GT(red, 0.4);
    EXPECT_LT(red, 0.45);
    for (auto& camera : visible) camera[0] = 0;  // hidden from all: nobody saw it
    blend_agreeing({sample_of, share_of, visible_of, 1, 0.04F * 65535}, sums);
    EXPECT_EQ(sums, (std::array<float, 4>{}));
    for (std::size_t i = 0; i < kCameras; ++i) visible[i][0] = i == 3 ? 0.0F : 1.0F;
  });
  const std::array<float, 4 * kMostRun> nothing{};
  const std::vector<const float*> none{nothing.data()};
  std::array<float, 4> sums{1, 1, 1, 1};
  blend_agreeing({none, std::span(share_of).first(1), std::span(visible_of).first(1), 1, 655},
                 sums);
  EXPECT_EQ(sums, (std::array<float, 4>{}));
}

}  // namespace
}  // namespace raystage
