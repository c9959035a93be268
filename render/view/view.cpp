// SPDX-License-Identifier: Apache-2.0
#include "render/view/view.h"

#include <cmath>
#include <limits>

namespace raystage {

VirtualCamera virtual_camera_from_geometry(const CameraGeometry& geometry) {
  return {geometry.width, geometry.height, geometry.intrinsics,
          pose_from_matrix(geometry.world_from_camera)};
}

VirtualCamera virtual_camera_with_fov(int width, int height, double horizontal_fov,
                                      const Pose& pose) {
  const double focal_length = width / (2 * std::tan(horizontal_fov / 2));
  return {width, height, {focal_length, focal_length, width / 2.0, height / 2.0, {}}, pose};
}

RenderedView empty_view(const VirtualCamera& view) {
  RenderedView image;
  image.width = view.width;
  image.height = view.height;
  const std::size_t pixels =
      static_cast<std::size_t>(view.width) * static_cast<std::size_t>(view.height);
  image.rgba.assign(pixels * 4, 0.0F);
  image.coverage.assign(pixels, 0.0F);
  image.z.assign(pixels, std::numeric_limits<float>::infinity());
  return image;
}

}  // namespace raystage
