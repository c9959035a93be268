// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>

#include "compose/color/color_config.h"
#include "compose/exr/exr_file.h"
#include "store/jpeg/rgb_image.h"

namespace raystage {

/// What shows through where a picture is not opaque.
enum class Background {
  kChecker,  ///< squares of 16 pixels, linear 0.18 and 0.09
  kBlack
};

/// How scene-linear light becomes a picture on a monitor.
struct DisplaySettings {
  double exposure = 0;  ///< stops: light is multiplied by 2^exposure before it is shown
  Background background = Background::kChecker;
  /// Of which displays and views are; none: the built-in config, and for pictures in linear Rec.709
  /// that no view is asked for, sRGB's curve without any config.
  std::optional<ColorConfig> colors = {};
  std::string monitor = {}, view = {};  ///< the config's names; empty: its defaults
  std::string space = {};  ///< of the pictures; empty: as their files say, else linear Rec.709
};

/// Over the background, then as the display's view shows it (sRGB's curve unless told); above 1 it
/// is cut. Throws Error (bad input) for a colour space, display or view that the config does not
/// know.
RgbImage display(const ExrImage& image, const DisplaySettings& settings);

/// The picture at another size, at most its own, each pixel the mean of the area that it covers
/// (premultiplied linear light).
ExrImage downscale(const ExrImage& image, int width, int height);

}  // namespace raystage
