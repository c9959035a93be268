// SPDX-License-Identifier: Apache-2.0
#include "render/view.h"

#include <cmath>

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

}  // namespace raystage
