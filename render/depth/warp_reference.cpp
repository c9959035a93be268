// SPDX-License-Identifier: Apache-2.0
// Reference of warp_depths() (warp.cpp), pixel by pixel for the whole view. Each pixel of a
// camera's inverse depth map (1/m) is splatted over the pixels of the view that it covers, and the
// nearest wins. Cost: O(pixels of the map + pixels written).
#include <algorithm>
#include <cmath>

#include "render/depth/warp.h"

namespace raystage::render {

InverseDepthMap warp_depths_reference(const InverseDepthMap& map, const VirtualCamera& camera,
                                      const VirtualCamera& view) {
  InverseDepthMap warped(view.width, view.height, kUnknownDepth);
  const PixelTransfer t = pixel_transfer(view, camera);
  // The footprint of a pixel is the ratio of the focal lengths times that of the depths, W.
  const double focal_ratio = std::max(view.intrinsics.fx / camera.intrinsics.fx,
                                      view.intrinsics.fy / camera.intrinsics.fy);
  for (int y = 0; y < map.height; ++y) {
    for (int x = 0; x < map.width; ++x) {
      const double q = static_cast<double>(map.at(x, y));
      if (q < 0) continue;
      const auto part = [&](std::size_t r) {
        const double* m = t.direction.data() + 3 * r;
        return m[0] * (x + 0.5) + m[1] * (y + 0.5) + m[2] + q * t.parallax[r];
      };
      const double w = part(2);
      if (!(w > 0)) continue;
      const double u = part(0) / w, v = part(1) / w;
      const double extent = std::min<double>(focal_ratio / w, kMaxSplatSize);
      const auto bound = [](double at, int size) {
        return static_cast<int>(std::clamp(at, 0.0, static_cast<double>(size)));
      };
      int left = bound(std::round(u - extent / 2), view.width);
      int right = bound(std::round(u + extent / 2), view.width);
      int top = bound(std::round(v - extent / 2), view.height);
      int bottom = bound(std::round(v + extent / 2), view.height);
      if (focal_ratio / w <= static_cast<double>(kSinglePixelFootprint)) {
        if (!(u >= 0 && v >= 0)) continue;
        left = bound(u, view.width);
        top = bound(v, view.height);
        right = std::min(left + 1, view.width);
        bottom = std::min(top + 1, view.height);
      }
      for (int row = top; row < bottom; ++row) {
        for (int column = left; column < right; ++column) {
          float& known = warped.at(column, row);
          known = std::max(known, static_cast<float>(q / w));
        }
      }
    }
  }
  return warped;
}

}  // namespace raystage::render
