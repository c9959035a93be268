// SPDX-License-Identifier: Apache-2.0
#include "rig/photometric_model.h"

#include <gtest/gtest.h>

#include <cmath>

#include "base/error.h"

namespace raystage::rig {
namespace {

constexpr PictureSize kSize{640, 480};

schemas::PhotometricResponse everything() {
  schemas::PhotometricResponse response;
  response.contrast = {1.2, 0.8, 1.05};
  response.brightness = {0.01, -0.02, 0.003};
  response.vignetting = schemas::Vignetting{330, 235, {0.3, 0.1, 0.02}};
  response.gain_map =
      schemas::GainMap{2, 3, {{1, 1, 1}, {2, 1, 1}, {1, 1, 1}, {1, 3, 1}, {1, 1, 1}, {1, 1, 4}}};
  response.matrix = {{{1.1, -0.2, 0.1}, {0.05, 0.9, 0.05}, {-0.1, -0.1, 1.2}}};
  return response;
}

TEST(Photometric, ContrastAndBrightnessAreEquation4_1) {
  schemas::PhotometricResponse response;
  response.contrast = {1.5, 1, 0.5};
  response.brightness = {0.1, 0, -0.1};
  const schemas::Rgb light = apply_photometric_correction(response, kSize, 3, 4, {0.2, 0.4, 0.6});
  EXPECT_DOUBLE_EQ(light[0], 0.1 + 1.5 * 0.2);
  EXPECT_DOUBLE_EQ(light[1], 0.4);
  EXPECT_DOUBLE_EQ(light[2], -0.1 + 0.5 * 0.6);
}

TEST(Photometric, VignettingIsDngsPolynomialInHalfDiagonals) {
  schemas::PhotometricResponse response;
  response.vignetting = schemas::Vignetting{0.5, 0.5, {0.25, 0.5, 1}};
  EXPECT_DOUBLE_EQ(gain_at(response, kSize, 0.5, 0.5)[1], 1);
  EXPECT_NEAR(gain_at(response, kSize, 400.5, 0.5)[1], 1 + 0.25 + 0.5 + 1, 1e-12);  // half of 800
  EXPECT_NEAR(gain_at(response, kSize, 0.5, 200.5)[2], 1 + 0.25 / 4 + 0.5 / 16 + 1.0 / 64, 1e-12);
}

TEST(Photometric, GainMapIsBilinearFromCornerToCorner) {
  schemas::PhotometricResponse response;
  response.gain_map = schemas::GainMap{2, 2, {{1, 1, 1}, {3, 1, 1}, {1, 1, 1}, {3, 1, 1}}};
  EXPECT_NEAR(gain_at(response, kSize, 0.5, 0.5)[0], 1 + 2 * 0.5 / 640, 1e-12);
  EXPECT_NEAR(gain_at(response, kSize, 639.5, 479.5)[0], 3 - 2 * 0.5 / 640, 1e-12);
  EXPECT_DOUBLE_EQ(gain_at(response, kSize, 320, 9)[1], 1);
  response = everything();
  response.vignetting.reset();
  // On the right edge, in the middle: the node of the second row has green 3.
  EXPECT_NEAR(gain_at(response, kSize, 639, 240)[1], 3, 0.02);
}

TEST(Photometric, ShownIsTheInverseOfLight) {
  const schemas::PhotometricResponse response = everything();
  for (const int x : {0, 17, 320, 639}) {
    for (const int y : {0, 240, 479}) {
      const schemas::Rgb shown{0.2, 0.5, 0.7}, dark{0.01, 0, 0.1};
      const schemas::Rgb light = apply_photometric_correction(response, kSize, x, y, shown, dark);
      const schemas::Rgb back = invert_photometric_correction(response, kSize, x, y, light, dark);
      for (std::size_t c = 0; c < 3; ++c) EXPECT_NEAR(back[c], shown[c], 1e-12);
    }
  }
  schemas::PhotometricResponse grey;
  grey.matrix = {{{1, 1, 1}, {1, 1, 1}, {1, 1, 1}}};
  EXPECT_THROW(invert_photometric_correction(grey, kSize, 0, 0, {1, 1, 1}), Error);
}

TEST(Photometric, CurvesAreStraightBetweenTheirNumbersAndInvert) {
  const std::vector<double> curve{0.02, 0.3, 0.55, 0.8, 1.1};
  EXPECT_DOUBLE_EQ(evaluate_response_curve(curve, 0), 0.02);
  EXPECT_DOUBLE_EQ(evaluate_response_curve(curve, 0.375), (0.3 + 0.55) / 2);
  EXPECT_DOUBLE_EQ(evaluate_response_curve(curve, 1), 1.1);
  for (int i = 0; i <= 100; ++i) {
    EXPECT_NEAR(invert_response_curve(curve, evaluate_response_curve(curve, i / 100.0)), i / 100.0,
                1e-12);
  }
  EXPECT_EQ(invert_response_curve(curve, 0), 0);
  EXPECT_EQ(invert_response_curve(curve, 2), 1);
  EXPECT_EQ(evaluate_response_curve({}, 0.3), 0.3);
  EXPECT_EQ(invert_response_curve({}, 1.3), 1);
}

}  // namespace
}  // namespace raystage::rig
