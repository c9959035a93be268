// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "rig/photometric_model.h"
#include "simulate/camera_renderer.h"
#include "store/jpeg/rgb_image.h"
#include "store/jpegxl/deep_picture.h"

namespace raystage::simulate {

/// Converts light (full scale 1) to the 8-bit codes of a camera: the inverse of `response`.
class SensorModel {
 public:
  /// Prepares the conversion. `noise`: standard deviation at full scale; it is proportional to the
  /// square root of the light.
  SensorModel(const schemas::PhotometricResponse& response, rig::PictureSize size, double noise);

  /// Returns the picture of an image, which must have the size given above. Noise depends on its
  /// seed only.
  store::RgbImage develop(const LinearImage& image, std::uint64_t noise_seed = 0) const;
  /// Returns the same as half floats of linear light, not clipped at white. The response must have
  /// no curve.
  store::DeepPicture develop_half(const LinearImage& image, std::uint64_t noise_seed = 0) const;

 private:
  /// Calls `put(value index, channel, light)` for each channel of each pixel in order.
  template <class Put>
  void expose(const LinearImage& image, std::uint64_t noise_seed, const Put& put) const;

  std::array<float, 3> gain_{}, offset_{};
  float noise_;
  bool mixes_;
  std::array<std::array<float, 3>, 3> sensor_from_light_{};
  std::vector<float> vignetting_;  ///< factor, R, G, B per pixel; empty: 1
  std::vector<schemas::HotPixel> hot_pixels_;
  /// Codes of 65536 light levels, per channel; empty: those of sRGB.
  std::array<std::vector<std::uint8_t>, 3> codes_;
};

/// Converts light to the codes of an ideal camera (sRGB, no noise).
store::RgbImage develop(const LinearImage& image);

}  // namespace raystage::simulate
