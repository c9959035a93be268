// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "store/jpeg/rgb_image.h"

namespace raystage::calibrate {

/// Result of detect_light().
enum class LightDetectionStatus : std::uint8_t {
  kFound,
  kDark,       ///< nothing bright enough
  kAmbiguous,  ///< a second spot of similar brightness: a reflection or another light
  kTooLarge,   ///< blown out, out of focus, or a lamp that lights the room
  kSaturated,  ///< too large a part is clipped to locate its centre
  kAtBorder,   ///< cut off by the picture's border
  kUnsteady    ///< much dimmer than usual for this camera: blinking or half hidden
};
inline constexpr std::size_t kLightDetectionStatusCount = 7;
std::string_view name_of(LightDetectionStatus result);

struct LightDetectionOptions {
  double min_light = 0.05;  ///< linear light above the background, full scale 1
  /// smallest ratio of the second spot's light to the first's that makes them ambiguous
  double ambiguity_ratio = 0.4;
  double max_area = 0.004;            ///< share of the picture
  double max_saturated_share = 0.75;  ///< share of its pixels at full scale, if these are many
  bool is_valid(std::string* reason) const;
};

/// A light in a picture.
struct LightSpot {
  LightDetectionStatus result = LightDetectionStatus::kDark;
  Eigen::Vector2d centre = Eigen::Vector2d::Zero();  ///< pixels, centres at +0.5
  double light = 0;  ///< sum over its pixels, linear, full scale 1, above the background
  int area = 0;      ///< pixels
};

/// Background of a camera without the light: per pixel the median of several pictures in which the
/// light is at different positions. Linear light, full scale 1.
class LightBackground {
 public:
  /// Computes the median of `pictures`: at least one, all of one size. `linear_from_code`: linear
  /// light, full scale 1, increasing.
  LightBackground(std::span<const store::RgbImage> pictures,
                  const std::array<float, 256>& linear_from_code);

  int width() const { return width_; }
  int height() const { return height_; }
  std::span<const float> light() const { return light_; }
  /// Returns the luminance of a pixel (Rec.709 weights), linear, full scale 1.
  float luminance(const std::uint8_t* rgb) const {
    return 0.2126F * linear_from_code_[rgb[0]] + 0.7152F * linear_from_code_[rgb[1]] +
           0.0722F * linear_from_code_[rgb[2]];
  }

 private:
  int width_ = 0, height_ = 0;
  std::array<float, 256> linear_from_code_;
  std::vector<float> light_;
};

/// Detects the light in a picture of the background's size. It is the connected component with the
/// most light, among pixels with at least a quarter of the largest brightness. Its centre is the
/// mean position of its pixels and those around it, weighted by their light.
LightSpot detect_light(const store::RgbImage& picture, const LightBackground& background,
                       const LightDetectionOptions& options);

}  // namespace raystage::calibrate
