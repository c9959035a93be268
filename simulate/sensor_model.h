// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "rig/photometric_model.h"
#include "simulate/camera_renderer.h"
#include "store/jpeg/rgb_image.h"

namespace raystage {

/// Converts light to the 8-bit sRGB codes of a camera: the inverse of `response`.
class SensorModel {
 public:
  /// `noise`: standard deviation at full scale; falls with the root of the light.
  SensorModel(const PhotometricResponse& response, PictureSize size, double noise);

  /// The picture's size is that given above. Noise is a function of its seed.
  RgbImage develop(const LinearImage& image, std::uint64_t noise_seed = 0) const;

 private:
  std::array<float, 3> gain_{}, offset_{};
  float noise_;
  bool mixes_;
  std::array<std::array<float, 3>, 3> sensor_from_light_{};
  std::vector<float> vignetting_;  ///< what is left of light, R, G, B per pixel; empty: all
  std::vector<HotPixel> hot_pixels_;
  /// Codes of 65536 levels of shown light, per channel; empty: sRGB's.
  std::array<std::vector<std::uint8_t>, 3> codes_;
};

/// As a camera without faults shows it.
RgbImage develop(const LinearImage& image);

}  // namespace raystage
