// SPDX-License-Identifier: Apache-2.0
#include "evaluation/region_errors.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

namespace raystage::evaluation::region_errors_test {
namespace {

constexpr int kWidth = 80, kHeight = 60;
constexpr double kScale = 20;  // a point at 2 m has 10 px of disparity

std::size_t at(int x, int y) { return static_cast<std::size_t>(y) * kWidth + x; }

/// A wall at 10 m (2 px), and in front of it from column 40 on a surface at 2 m (10 px).
std::vector<float> step() {
  std::vector<float> z(kWidth * kHeight, 10);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 40; x < kWidth; ++x) z[at(x, y)] = 2;
  }
  return z;
}

TEST(TruthRegions, BandsAreEightPixelsAboutEdges) {
  const std::vector<float> z = step();
  const TruthRegions regions = truth_regions({kWidth, kHeight, z, kScale});
  for (int x = 0; x < kWidth; ++x) {
    // Pixels 39 and 40 are at the edge.
    EXPECT_EQ(regions.edge_band[at(x, 30)], x >= 39 - 8 && x <= 40 + 8 ? 1 : 0) << x;
    EXPECT_EQ(regions.thin[at(x, 30)], 0) << x;
    EXPECT_EQ(regions.plane[at(x, 30)], x >= 2 && x < kWidth - 2 && (x < 38 || x >= 42) ? 1 : 0)
        << x;
  }
}

TEST(TruthRegions, ThinStructuresAreNarrowAndInFront) {
  for (const int width : {1, 3, 6, 7}) {
    std::vector<float> z(kWidth * kHeight, 10);
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 20; x < 20 + width; ++x) z[at(x, y)] = 2;
    }
    const TruthRegions regions = truth_regions({kWidth, kHeight, z, kScale});
    EXPECT_EQ(regions.thin[at(20, 30)], width <= 6 ? 1 : 0) << width;
    EXPECT_EQ(regions.thin[at(18, 30)], width <= 6 ? 1 : 0) << width;
    EXPECT_EQ(regions.thin[at(17, 30)], 0) << width;
  }
  // A slit is behind: it is no thin structure.
  std::vector<float> slit(kWidth * kHeight, 2);
  for (int y = 0; y < kHeight; ++y) slit[at(20, y)] = 10;
  EXPECT_EQ(std::ranges::count(truth_regions({kWidth, kHeight, slit, kScale}).thin, 1), 0);
}

TEST(TruthRegions, SlantedPlanesArePlanesAndSpheresAreNot) {
  std::vector<float> slanted, sphere;
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      slanted.push_back(static_cast<float>(kScale / (2 + 0.05 * x + 0.03 * y)));
      const double dx = x - 40, dy = y - 30;
      sphere.push_back(static_cast<float>(kScale / (2 + std::sqrt(2500 - dx * dx - dy * dy) / 20)));
    }
  }
  const auto planes = [](const std::vector<float>& z) {
    return std::ranges::count(truth_regions({kWidth, kHeight, z, kScale}).plane, 1);
  };
  EXPECT_EQ(planes(slanted), (kWidth - 4) * (kHeight - 4));
  EXPECT_LT(planes(sphere), 100);
  const std::vector<float> nothing(kWidth * kHeight, std::numeric_limits<float>::infinity());
  EXPECT_EQ(planes(nothing), 0);
}

// A mirror has no single depth: it has no edge, is no plane, and its depths are not wrong.
TEST(TruthRegions, UnknownDepthsBelongToNone) {
  std::vector<float> z(kWidth * kHeight, 10);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 40; x < 44; ++x) z[at(x, y)] = 0;
  }
  const TrueDepths truth{kWidth, kHeight, z, kScale};
  const TruthRegions regions = truth_regions(truth);
  EXPECT_EQ(std::ranges::count(regions.edge_band, 1), 0);
  EXPECT_EQ(std::ranges::count(regions.thin, 1), 0);
  EXPECT_EQ(regions.plane[at(39, 30)], 0);
  EXPECT_EQ(regions.plane[at(30, 30)], 1);
  const store::RgbImage image{kWidth, kHeight,
                              std::vector<std::uint8_t>(3 * kWidth * kHeight, 100)};
  std::vector<float> found = z;
  for (float& depth : found) depth = depth == 0 ? 2 : depth;
  const std::vector<std::uint8_t> covered(z.size(), 1);
  EXPECT_EQ(region_errors({image, image, covered, found}, truth, regions).bad_depths_half_px, 0);
}

TEST(RegionErrors, AreThoseOfTheirPixels) {
  const std::vector<float> z = step();
  const TrueDepths truth{kWidth, kHeight, z, kScale};
  const TruthRegions regions = truth_regions(truth);
  const store::RgbImage right{kWidth, kHeight,
                              std::vector<std::uint8_t>(3 * kWidth * kHeight, 100)};
  store::RgbImage image = right;
  std::vector<float> found = z;
  // Ten codes too bright in the band, and 0.75 px of disparity too near on the left half.
  for (std::size_t i = 0; i < z.size(); ++i) {
    if (regions.edge_band[i] != 0) {
      for (std::size_t c = 0; c < 3; ++c) image.values[3 * i + c] = 110;
    }
    if (z[i] == 10) found[i] = static_cast<float>(kScale / (kScale / 10 + 0.75));
  }
  std::vector<std::uint8_t> covered(z.size(), 1);
  const RegionErrors errors = region_errors({image, right, covered, found}, truth, regions);
  EXPECT_NEAR(errors.edge_band.psnr_db, 10 * std::log10(255 * 255 / 100.0), 1e-9);
  EXPECT_NEAR(errors.edge_band.share, 18.0 / kWidth, 1e-12);
  EXPECT_LT(errors.edge_band.ms_ssim, 1);
  EXPECT_TRUE(std::isnan(errors.thin.psnr_db));
  EXPECT_NEAR(errors.bad_depths_half_px, 0.5, 1e-12);
  EXPECT_EQ(errors.bad_depths_1_px, 0);
  const double left = 36.0 / (36 + 36);  // of the columns on planes
  EXPECT_NEAR(errors.plane_rms_px, 0.75 * std::sqrt(left), 1e-5);
  std::ranges::fill(covered, 0);
  EXPECT_TRUE(
      std::isnan(region_errors({image, right, covered, found}, truth, regions).bad_depths_1_px));
  const RegionErrors mean = mean_region_errors(std::vector{errors, errors});
  EXPECT_NEAR(mean.edge_band.psnr_db, errors.edge_band.psnr_db, 1e-12);
  EXPECT_TRUE(std::isnan(mean.thin.psnr_db));
}

}  // namespace
}  // namespace raystage::evaluation::region_errors_test
