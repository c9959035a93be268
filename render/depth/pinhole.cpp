// SPDX-License-Identifier: Apache-2.0
#include "render/depth/pinhole.h"

#include <algorithm>
#include <cmath>

#include "render/view/ray_cells.h"

namespace raystage {

InverseDepthMap nearest_of_blocks(const InverseDepthMap& map) {
  InverseDepthMap nearest{(map.width + kSightBlock - 1) / kSightBlock,
                          (map.height + kSightBlock - 1) / kSightBlock,
                          {}};
  for (int top = 0; top < map.height; top += kSightBlock) {
    for (int left = 0; left < map.width; left += kSightBlock) {
      float most = kUnknownDepth;
      for (int y = top; y <= std::min(top + kSightBlock, map.height - 1); ++y) {
        for (int x = left; x <= std::min(left + kSightBlock, map.width - 1); ++x) {
          most = std::max(most, map.at(x, y));
        }
      }
      nearest.values.push_back(most);
    }
  }
  return nearest;
}

PixelTransfer pixel_transfer(const VirtualCamera& to, const VirtualCamera& from) {
  const Intrinsics& k = to.intrinsics;
  Eigen::Matrix3d pixel_from_camera;  // x right, y up, looking down -z; times the depth
  pixel_from_camera << k.fx, 0, -k.cx, 0, -k.fy, -k.cy, 0, 0, -1;
  const Eigen::Matrix3d pixel_from_world =
      pixel_from_camera * to.pose.world_from_camera_rotation.transpose();
  const Eigen::Matrix3d direction = pixel_from_world * world_ray_from_pixel(from);
  const Eigen::Vector3d parallax = pixel_from_world * (from.pose.position - to.pose.position);
  PixelTransfer transfer;
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) {
      transfer.direction[static_cast<std::size_t>(3 * r + c)] = direction(r, c);
    }
    transfer.parallax[static_cast<std::size_t>(r)] = parallax[r];
  }
  return transfer;
}

VirtualCamera undistorted(const CameraModel& model, const Pose& pose) {
  VirtualCamera pinhole{model.width(), model.height(), model.intrinsics(), pose};
  if (!model.has_distortion()) return pinhole;
  pinhole.intrinsics.distortion = {};
  const Intrinsics& k = pinhole.intrinsics;
  double left = 0, right = model.width(), top = 0, bottom = model.height();
  constexpr int kParts = 32;  // of the frame's border, which bounds all within
  for (int i = 0; i <= kParts; ++i) {
    const double along_x = model.width() * static_cast<double>(i) / kParts;
    const double along_y = model.height() * static_cast<double>(i) / kParts;
    for (const Eigen::Vector2d& pixel :
         {Eigen::Vector2d(along_x, 0), Eigen::Vector2d(along_x, model.height()),
          Eigen::Vector2d(0, along_y), Eigen::Vector2d(model.width(), along_y)}) {
      const auto ideal = model.ideal_from_pixel(pixel);
      if (!ideal) continue;
      left = std::min(left, k.fx * ideal->x() + k.cx);
      right = std::max(right, k.fx * ideal->x() + k.cx);
      top = std::min(top, k.fy * ideal->y() + k.cy);
      bottom = std::max(bottom, k.fy * ideal->y() + k.cy);
    }
  }
  const auto grown = [](double from, double to, int size) {
    const double half = size / 2.0;  // at most half a frame more on each side
    return std::pair(std::floor(std::max(from, -half)), std::ceil(std::min(to, size + half)));
  };
  const auto [x0, x1] = grown(left, right, model.width());
  const auto [y0, y1] = grown(top, bottom, model.height());
  pinhole.width = static_cast<int>(x1 - x0);
  pinhole.height = static_cast<int>(y1 - y0);
  pinhole.intrinsics.cx -= x0;
  pinhole.intrinsics.cy -= y0;
  return pinhole;
}

}  // namespace raystage
