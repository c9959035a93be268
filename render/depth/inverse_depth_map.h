// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <vector>

#include "render/common/view.h"
#include "rig/rig.h"

namespace raystage {

/// Inverse planar depths (1/m along the axis, 0 = infinity) at the pixel centres of a camera
/// without distortion, row-major.
struct InverseDepthMap {
  int width = 0, height = 0;  ///< pixels
  std::vector<float> values;

  float at(int x, int y) const {
    return values[static_cast<std::size_t>(y) * static_cast<std::size_t>(width) +
                  static_cast<std::size_t>(x)];
  }
};

/// What a map says of a pixel that it knows nothing of.
inline constexpr float kUnknownDepth = -1;

/// Of each block of kVisibilityBlock x kVisibilityBlock pixels the nearest depth that bilinear
/// samples meet which start in it: of the block, and of the column right of it and the row below.
InverseDepthMap block_nearest_depths(const InverseDepthMap& map);
inline constexpr int kVisibilityBlockLog2 = 3, kVisibilityBlock = 1 << kVisibilityBlockLog2;

/// Where a camera without distortion sees what another one sees at pixel (x, y) and inverse planar
/// depth q: (X, Y, W) = direction * (x, y, 1) + q * parallax is, if W > 0, its pixel (X/W, Y/W) and
/// the inverse planar depth q/W along its axis. Exact for points at infinity.
struct PixelTransfer {
  std::array<double, 9> direction{};  ///< row-major
  std::array<double, 3> parallax{};
};
PixelTransfer pixel_transfer(const VirtualCamera& to, const VirtualCamera& from);

}  // namespace raystage
