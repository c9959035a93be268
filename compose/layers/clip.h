// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <span>
#include <variant>

#include "compose/layers/layer_image.h"
#include "render/common/view.h"

namespace raystage::compose {

/// Keeps the side of a plane that its normal points to.
struct PlaneClip {
  Eigen::Vector4d plane{0, 0, 1, 0};  ///< a x + b y + c z + d = 0, world, metres
  double feather = 0;                 ///< width of the ramp, metres, half of it on each side
};

/// Keeps the inside of an axis-aligned box.
struct BoxClip {
  Eigen::Vector3d min{0, 0, 0}, max{0, 0, 0};  ///< world, metres
  double feather = 0;
};

/// Keeps a rectangle of the picture, in shares of its width and height from the top left.
struct ScreenClip {
  double left = 0, right = 1, top = 0, bottom = 1;
  double feather = 0;  ///< width of the ramp at inner edges, share of the picture's width
};

struct Clip {
  std::variant<PlaneClip, BoxClip, ScreenClip> shape;
  bool inverted = false;  ///< keeps the outside instead
};

/// Returns the share of a point that a clip keeps, 0 to 1, with a linear ramp. Two clips that
/// differ only in `inverted` add up to 1, so that complementary layers have no seam. `pixel`: from
/// the top left; `point`: world, metres, or a direction if the pixel is at infinity.
double kept_share(const Clip& clip, const render::VirtualCamera& camera,
                  const Eigen::Vector2d& pixel, const Eigen::Vector3d& point, bool is_direction);

/// Multiplies colours and alpha by the shares that all clips keep. Where that is 0, Z and AOVs get
/// their empty values. World points follow from the image's Z.
void apply(std::span<const Clip> clips, const render::VirtualCamera& camera, LayerImage& image);

/// Returns false if the screen clips alone remove every pixel.
bool keeps_any_pixel(std::span<const Clip> clips);

}  // namespace raystage::compose
