// SPDX-License-Identifier: Apache-2.0
#include "render/common/image_quality.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "base/error.h"

namespace raystage::render {
namespace {

store::RgbImage gradient(int width, int height, int offset) {
  store::RgbImage image{width, height, std::vector<std::uint8_t>()};
  for (int i = 0; i < width * height; ++i) {
    for (int c = 0; c < 3; ++c) {
      image.values.push_back(static_cast<std::uint8_t>(20 + (i * 7 + c * 31) % 200 + offset));
    }
  }
  return image;
}

TEST(ImageQuality, EqualImagesHaveNoError) {
  const store::RgbImage image = gradient(20, 16, 0);
  const std::vector<std::uint8_t> covered(20 * 16, 1);
  const ImageQuality quality = compare_images(image, image, covered);
  EXPECT_EQ(quality.psnr_db, std::numeric_limits<double>::infinity());
  EXPECT_NEAR(quality.ssim, 1, 1e-12);
  EXPECT_EQ(quality.covered, 1);
}

TEST(ImageQuality, PsnrIsTheFormulaOverCoveredPixelsOnly) {
  const store::RgbImage truth = gradient(20, 16, 0);
  store::RgbImage image = gradient(20, 16, 5);
  std::vector<std::uint8_t> covered(20 * 16, 1);
  EXPECT_NEAR(compare_images(image, truth, covered).psnr_db, 10 * std::log10(255 * 255 / 25.0),
              1e-9);
  for (std::size_t i = 0; i < 160; ++i) {  // change pixels that are not covered
    covered[i] = 0;
    image.values[i * 3] = 255;
  }
  const ImageQuality half = compare_images(image, truth, covered);
  EXPECT_NEAR(half.psnr_db, 10 * std::log10(255 * 255 / 25.0), 1e-9);
  EXPECT_EQ(half.covered, 0.5);
  EXPECT_LT(half.ssim, 1);
  EXPECT_GT(half.ssim, 0.9);
}

TEST(ImageQuality, SsimOfAFlatPairIsItsClosedForm) {
  // Without variance only the luminance term remains: (2 a b + C1) / (a^2 + b^2 + C1).
  const store::RgbImage a{30, 30, std::vector<std::uint8_t>(2700, 100)};
  const store::RgbImage b{30, 30, std::vector<std::uint8_t>(2700, 140)};
  const double c1 = 2.55 * 2.55;
  EXPECT_NEAR(compare_images(a, b, std::vector<std::uint8_t>(900, 1)).ssim,
              (2 * 100 * 140.0 + c1) / (100 * 100 + 140 * 140 + c1), 1e-9);
}

TEST(MultiScaleSsim, IsOneForEqualImagesAndFallsWithErrors) {
  const store::RgbImage truth = gradient(200, 180, 0);
  const std::vector<std::uint8_t> all(200 * 180, 1);
  EXPECT_NEAR(multi_scale_ssim(truth, truth, all, all), 1, 1e-12);
  store::RgbImage image = truth;
  for (std::size_t i = 0; i < 100 * 200 * 3; i += 7) image.values[i] ^= 16U;
  const double whole = multi_scale_ssim(image, truth, all, all);
  EXPECT_LT(whole, 0.999);
  EXPECT_GT(whole, 0.5);
  // Errors far from the mask do not count, errors within do.
  std::vector<std::uint8_t> below(all.size(), 0), above(all.size(), 0);
  std::fill(below.end() - 200 * 4, below.end(), 1);
  std::fill(above.begin(), above.begin() + 200 * 4, 1);
  EXPECT_GT(multi_scale_ssim(image, truth, all, below), whole);
  EXPECT_LT(multi_scale_ssim(image, truth, all, above), whole);
  EXPECT_TRUE(
      std::isnan(multi_scale_ssim(image, truth, all, std::vector<std::uint8_t>(all.size()))));
  EXPECT_THROW(multi_scale_ssim(image, gradient(20, 16, 0), all, all), Error);
}

// One scale, flat images: the luminance term alone, as SSIM.
TEST(MultiScaleSsim, OfASmallFlatPairIsItsClosedForm) {
  const store::RgbImage a{20, 20, std::vector<std::uint8_t>(1200, 100)};
  const store::RgbImage b{20, 20, std::vector<std::uint8_t>(1200, 140)};
  const std::vector<std::uint8_t> all(400, 1);
  const double c1 = 2.55 * 2.55;
  EXPECT_NEAR(multi_scale_ssim(a, b, all, all),
              (2 * 100 * 140.0 + c1) / (100 * 100 + 140 * 140 + c1), 1e-9);
}

TEST(ImageQuality, NothingCoveredIsNotANumber) {
  const store::RgbImage image = gradient(4, 4, 0);
  EXPECT_TRUE(std::isnan(compare_images(image, image, std::vector<std::uint8_t>(16, 0)).psnr_db));
}

TEST(ImageQuality, RefusesDifferentSizes) {
  EXPECT_THROW(
      compare_images(gradient(4, 4, 0), gradient(4, 5, 0), std::vector<std::uint8_t>(16, 1)),
      Error);
}

TEST(ImageQuality, ViewsAreUnpremultipliedBeforeTheyAreShown) {
  RenderedView view;
  view.width = view.height = 1;
  view.rgba = {0.25F, 0.25F, 0.25F, 0.5F};
  view.coverage = {0.5F};
  EXPECT_EQ(srgb_image(view).values[0], 188);  // sRGB code of linear 0.5
  EXPECT_EQ(coverage_mask(view)[0], 0);
}

}  // namespace
}  // namespace raystage::render
