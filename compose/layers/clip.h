// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <span>
#include <variant>

#include "compose/layers/layer_image.h"
#include "render/view/view.h"

namespace raystage {

/// Keeps what lies on the side of a plane that its normal points to.
struct PlaneClip {
  Eigen::Vector4d plane{0, 0, 1, 0};  ///< a x + b y + c z + d = 0, world, metres
  double feather = 0;                 ///< metres over which it fades, half on either side
};

/// Keeps what lies within an upright box.
struct BoxClip {
  Eigen::Vector3d least{0, 0, 0}, most{0, 0, 0};  ///< world, metres
  double feather = 0;
};

/// Keeps a part of the picture, in shares of its width and height from the top left.
struct ScreenClip {
  double left = 0, right = 1, top = 0, bottom = 1;
  double feather = 0;  ///< share of the picture's width over which an inner edge fades
};

struct Clip {
  std::variant<PlaneClip, BoxClip, ScreenClip> shape;
  bool inverted = false;  ///< keeps the rest instead
};

/// How much of a point or a pixel is kept, 0 to 1, along a straight ramp. A layer clipped so over
/// one that is not leaves no seam; two clips that differ in `inverted` alone add up to 1. `pixel`:
/// in pixels from the top left; `point`: world, metres, or a direction where the pixel shows what
/// is infinitely far.
double kept(const Clip& clip, const VirtualCamera& camera, const Eigen::Vector2d& pixel,
            const Eigen::Vector3d& point, bool is_direction);

/// Multiplies colours and alpha by what all clips keep; where that is nothing, Z and AOVs tell of
/// nothing. World points are those at the image's Z.
void apply(std::span<const Clip> clips, const VirtualCamera& camera, LayerImage& image);

/// Whether some pixel may be kept: false only where the clips say no everywhere, by the screen
/// alone.
bool keeps_something(std::span<const Clip> clips);

}  // namespace raystage
