// SPDX-License-Identifier: Apache-2.0
#include "evaluation/light_errors.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

namespace raystage::evaluation::light_errors_test {
namespace {

/// Returns a view of one row with these values in R, G and B, covered.
render::RenderedView row_of(const std::vector<float>& values) {
  render::RenderedView view;
  view.width = static_cast<int>(values.size());
  view.height = 1;
  for (const float value : values) view.rgba.insert(view.rgba.end(), {value, value, value, 1});
  return view;
}

std::vector<float> rgb_of(const std::vector<float>& values) {
  std::vector<float> rgb;
  for (const float value : values) rgb.insert(rgb.end(), {value, value, value});
  return rgb;
}

const std::vector<std::uint8_t> kAll(4, 1);

// Published properties of PU21: 100 cd/m2 is code 256, the range 0.005 to 10,000 cd/m2 is 0 to 595.
TEST(LightErrors, CodesAreThoseOfTheirSource) {
  EXPECT_NEAR(pu21_code(100.0 / 203), 256, 0.5);
  EXPECT_NEAR(pu21_code(0), 0, 1e-6);
  EXPECT_NEAR(pu21_code(1e6), 595.394, 0.001);
  EXPECT_EQ(pu21_code(-1), pu21_code(0));
}

TEST(LightErrors, HighlightsThatAreClippedCount) {
  const std::vector<float> truth{0.01F, 0.5F, 2, 32};
  const LightErrors equal = light_errors(row_of(truth), rgb_of(truth), kAll);
  EXPECT_TRUE(std::isinf(equal.pu_psnr_db));
  EXPECT_EQ(equal.highlight_rms_stops, 0);
  EXPECT_EQ(equal.highlight_share, 0.5);
  // Clipped at white: 1 and 5 stops are lost.
  const LightErrors clipped = light_errors(row_of({0.01F, 0.5F, 1, 1}), rgb_of(truth), kAll);
  EXPECT_NEAR(clipped.highlight_rms_stops, std::sqrt((1 + 25) / 2.0), 1e-9);
  const double lost =
      std::pow(pu21_code(2) - pu21_code(1), 2) + std::pow(pu21_code(32) - pu21_code(1), 2);
  EXPECT_NEAR(clipped.pu_psnr_db, 10 * std::log10(256 * 256 * 4 / lost), 1e-6);
}

TEST(LightErrors, OnlyCoveredPixelsCount) {
  const std::vector<float> truth{0.01F, 0.5F, 0.9F, 32};
  const std::vector<std::uint8_t> covered{1, 1, 1, 0};
  const LightErrors errors = light_errors(row_of({0.01F, 0.6F, 0.9F, 0}), rgb_of(truth), covered);
  EXPECT_TRUE(std::isfinite(errors.pu_psnr_db));
  EXPECT_TRUE(std::isnan(errors.highlight_rms_stops)) << "no covered pixel is above white";
  EXPECT_EQ(errors.highlight_share, 0);
  const std::vector<std::uint8_t> none(4, 0);
  EXPECT_TRUE(std::isnan(light_errors(row_of(truth), rgb_of(truth), none).pu_psnr_db));
  const LightErrors empty = light_errors(row_of(truth), rgb_of(truth), none);
  EXPECT_EQ(mean_light_errors(std::vector{errors, empty}).pu_psnr_db, errors.pu_psnr_db);
}

}  // namespace
}  // namespace raystage::evaluation::light_errors_test
