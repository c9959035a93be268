// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>

#include "compose/color/color_config.h"
#include "compose/exr/exr_file.h"
#include "store/jpeg/rgb_image.h"

namespace raystage::compose {

/// Background of transparent pixels.
enum class Background {
  kChecker,  ///< squares of 16 pixels, linear 0.18 and 0.09
  kBlack
};

/// How scene-linear light is converted to display codes.
struct DisplayOptions {
  double exposure = 0;  ///< stops: light is multiplied by 2^exposure
  Background background = Background::kChecker;
  /// Config of displays and views; none: the built-in config, or just the sRGB curve for pictures
  /// in linear Rec.709 if neither display nor view is given.
  std::optional<ColorConfig> colors = {};
  std::string monitor = {}, view = {};  ///< names in the config; empty: its defaults
  std::string space = {};  ///< of the pictures; empty: that of their files, else linear Rec.709
};

/// Converts scene-linear pixels to display codes: exposure, over the background, then the view of
/// the display, clamped at 1. Thread-safe.
class DisplayTransform {
 public:
  /// `interop_id`, `color_space`: of the pictures, as ExrImage. Throws Error (bad input) if the
  /// config has no such colour space, display or view.
  DisplayTransform(const DisplayOptions& options, const std::string& interop_id,
                   const std::string& color_space);

  /// Converts row `y` of a picture. `rgba`: premultiplied; `codes`: R, G, B of each pixel.
  void apply_row(std::span<const float> rgba, int y, std::span<std::uint8_t> codes) const;

 private:
  float gain_;
  Background background_;
  std::optional<ColorTransform> transform_;  ///< none: the sRGB curve
};

/// Composites the image over the background and converts it to display codes, clamped at 1. Throws
/// Error (bad input) if the config has no such colour space, display or view.
store::RgbImage display(const ExrImage& image, const DisplayOptions& options);

/// Returns the image at a size that is at most its own. Each pixel is the mean of the area that it
/// covers, in premultiplied linear light.
ExrImage downscale(const ExrImage& image, int width, int height);

}  // namespace raystage::compose
