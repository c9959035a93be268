// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "compose/exr/file.h"
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
};

/// Over the background, then the sRGB curve; above 1 it is cut.
RgbImage display(const ExrImage& image, const DisplaySettings& settings);

/// The picture at another size, at most its own, each pixel the mean of the area that it covers
/// (premultiplied linear light).
ExrImage reduced(const ExrImage& image, int width, int height);

}  // namespace raystage
