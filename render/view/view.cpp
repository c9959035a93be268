// SPDX-License-Identifier: Apache-2.0
#include "render/view/view.h"

#include <algorithm>
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
  RenderedView image = unset_view(view);
  std::ranges::fill(image.rgba, 0.0F);
  std::ranges::fill(image.coverage, 0.0F);
  std::ranges::fill(image.z, std::numeric_limits<float>::infinity());
  return image;
}

RenderedView unset_view(const VirtualCamera& view) {
  RenderedView image;
  image.width = view.width;
  image.height = view.height;
  const std::size_t pixels =
      static_cast<std::size_t>(view.width) * static_cast<std::size_t>(view.height);
  image.rgba.resize(pixels * 4);
  image.coverage.resize(pixels);
  image.z.resize(pixels);
  return image;
}

}  // namespace raystage
