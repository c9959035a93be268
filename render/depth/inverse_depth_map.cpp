// SPDX-License-Identifier: Apache-2.0
// Computes the nearest depths of blocks of an inverse depth map (1/m), and the transfer of pixels
// with inverse depths between two cameras: a homography plus the inverse depth times the epipole.
// Cost: O(pixels) and constant.
#include "render/depth/inverse_depth_map.h"

#include <algorithm>

#include "render/common/ray_cells.h"

namespace raystage::render {

InverseDepthMap block_nearest_depths(const InverseDepthMap& map) {
  InverseDepthMap nearest((map.width + kVisibilityBlock - 1) / kVisibilityBlock,
                          (map.height + kVisibilityBlock - 1) / kVisibilityBlock, kUnknownDepth);
  for (int top = 0; top < map.height; top += kVisibilityBlock) {
    for (int left = 0; left < map.width; left += kVisibilityBlock) {
      float& most = nearest.at(left / kVisibilityBlock, top / kVisibilityBlock);
      for (int y = top; y <= std::min(top + kVisibilityBlock, map.height - 1); ++y) {
        for (int x = left; x <= std::min(left + kVisibilityBlock, map.width - 1); ++x) {
          most = std::max(most, map.at(x, y));
        }
      }
    }
  }
  return nearest;
}

PixelTransfer pixel_transfer(const VirtualCamera& to, const VirtualCamera& from) {
  const schemas::Intrinsics& k = to.intrinsics;
  Eigen::Matrix3d pixel_from_camera;  // x right, y up, looking down -z; times the depth
  pixel_from_camera << k.fx, 0, -k.cx, 0, -k.fy, -k.cy, 0, 0, -1;
  const Eigen::Matrix3d pixel_from_world =
      pixel_from_camera * to.pose.world_from_camera_rotation.transpose();
  const Eigen::Matrix3d direction = pixel_from_world * world_ray_from_pixel(from);
  const Eigen::Vector3d parallax = pixel_from_world * (from.pose.position - to.pose.position);
  PixelTransfer transfer;
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) transfer.direction[3 * r + c] = direction(r, c);
    transfer.parallax[r] = parallax[r];
  }
  return transfer;
}

}  // namespace raystage::render
