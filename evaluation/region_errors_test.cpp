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

// A surface at 2 m covers 30 % of the pixels of column 40 and all to their right; behind it is a
// wall at 10 m.
TEST(RegionErrors, AlphaIsThatOfPixelsWithTwoSurfaces) {
  const std::vector<float> z = step();
  std::vector<TrueSurfaces> surfaces(z.size(), {1, 10, 10});
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 40; x < kWidth; ++x) surfaces[at(x, y)] = {1, 2, 2};
    surfaces[at(40, y)] = {0.3F, 2, 10};
  }
  const TrueDepths depths{kWidth, kHeight, z, kScale};
  const TruthRegions regions = truth_regions(depths);
  const store::RgbImage image{kWidth, kHeight, std::vector<std::uint8_t>(3 * z.size(), 100)};
  const std::vector<std::uint8_t> covered(z.size(), 1);
  const auto errors = [&](const std::vector<render::EdgePixel>& edges) {
    return region_errors({image, image, covered, z, edges}, depths, regions, surfaces);
  };
  // Hard: the pixel is the surface's.
  EXPECT_NEAR(errors({}).edge_alpha, 0.7, 1e-6);
  EXPECT_NEAR(errors({}).edge_alpha_gradient, 0, 1e-6) << "its neighbours are right";
  std::vector<render::EdgePixel> edges;
  for (int y = 0; y < kHeight; ++y) {
    edges.push_back({static_cast<std::uint32_t>(at(40, y)), {0, 0, 0, 0.4F}, {0, 0, 0, 1}, 2, 10});
  }
  EXPECT_NEAR(errors(edges).edge_alpha, 0.1, 1e-6);
  for (render::EdgePixel& edge : edges) --edge.pixel;  // one column too far to the left
  EXPECT_NEAR(errors(edges).edge_alpha, 0.7, 1e-6);
  EXPECT_NEAR(errors(edges).edge_alpha_gradient, 0.2, 1e-6);
  const RegionErrors unknown = region_errors({image, image, covered, z, {}}, depths, regions);
  EXPECT_TRUE(std::isnan(unknown.edge_alpha));
  EXPECT_TRUE(std::isnan(unknown.edge_alpha_gradient));
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
