// SPDX-License-Identifier: Apache-2.0
#include "simulate/sensor_model.h"

#include <gtest/gtest.h>

#include <cmath>

#include "base/transfer_function.h"
#include "simulate/simulated_response.h"

namespace raystage::simulate {
namespace {

LinearImage even_image(int width, int height, const Eigen::Vector3f& light) {
  return {width,
          height,
          std::vector<Eigen::Vector3f>(static_cast<std::size_t>(width * height), light),
          {}};
}

TEST(SensorModel, AppliesTheInverseOfTheResponse) {
  const LinearImage image = even_image(1, 1, {0.5F, 0.5F, 0.5F});
  EXPECT_EQ(develop(image).values[0], 188);  // sRGB of 0.5
  // light = brightness + contrast * shown
  schemas::PhotometricResponse response;
  response.contrast = {2, 1, 1};
  response.brightness = {0, 0.25, 0};
  const store::RgbImage codes = SensorModel(response, {1, 1}, 0).develop(image);
  EXPECT_EQ(codes.values[0], 137);  // sRGB of 0.25
  EXPECT_EQ(codes.values[1], 137);
  EXPECT_EQ(codes.values[2], 188);
}

TEST(SensorModel, NoiseHasTheStrengthAsked) {
  const LinearImage image = even_image(100, 100, {0.5F, 0.5F, 0.5F});
  const SensorModel noisy({}, {100, 100}, 0.02);
  const store::RgbImage codes = noisy.develop(image, 5);
  double sum = 0, squares = 0;
  for (const std::uint8_t code : codes.values) {
    sum += code - 188.0;
    squares += (code - 188.0) * (code - 188.0);
  }
  const auto count = static_cast<double>(codes.values.size());
  EXPECT_NEAR(sum / count, 0, 0.6);
  // d(code)/d(light) at 0.5 is 164; the noise falls with the root of the light.
  EXPECT_NEAR(std::sqrt(squares / count), 164 * 0.02 * std::sqrt(0.5), 0.25);
  EXPECT_EQ(noisy.develop(image, 5).values, codes.values);
}

TEST(SensorModel, WhatItShowsTheResponseTurnsBackIntoLight) {
  SimulationOptions options;
  options.width = 96;
  options.height = 64;
  options.color_errors = {0.2, 0.1, 0.03, 0.3, 0.1, 0.1, 40};
  const rig::PictureSize size{options.width, options.height};
  for (const std::uint64_t camera : {0U, 1U, 2U}) {
    const schemas::PhotometricResponse response = simulated_response(options, camera);
    const schemas::Rgb light{0.4, 0.45, 0.35};
    const store::RgbImage codes =
        SensorModel(response, size, 0)
            .develop(even_image(size.width, size.height, {0.4F, 0.45F, 0.35F}));
    EXPECT_NEAR(static_cast<double>(response.hot_pixels.size()), 40, 3);
    EXPECT_LE(1 / rig::gain_at(response, size, 96, 64)[0], 0.85);
    EXPECT_GE(1 / rig::gain_at(response, size, 96, 64)[0], 0.65);
    for (int y = 0; y < size.height; ++y) {
      for (int x = 0; x < size.width; ++x) {
        schemas::Rgb dark{};
        for (const schemas::HotPixel& pixel : response.hot_pixels) {
          if (pixel.x == x && pixel.y == y) dark = pixel.light;
        }
        schemas::Rgb shown{};
        bool is_clipped = false;
        for (std::size_t c = 0; c < 3; ++c) {
          const int code = codes.values[3 * static_cast<std::size_t>(y * size.width + x) + c];
          is_clipped = is_clipped || code == 255;
          shown[c] =
              linear_from_srgb(rig::evaluate_response_curve(response.curve[c], code / 255.0));
        }
        if (is_clipped) continue;
        const schemas::Rgb found =
            rig::apply_photometric_correction(response, size, x, y, shown, dark);
        for (std::size_t c = 0; c < 3; ++c)
          EXPECT_NEAR(found[c], light[c], 0.007);  // half a code times the gain
      }
    }
  }
}

}  // namespace
}  // namespace raystage::simulate
