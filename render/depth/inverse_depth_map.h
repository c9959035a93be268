// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>

#include "base/image.h"
#include "render/common/view.h"
#include "rig/rig.h"

namespace raystage::render {

/// Inverse planar depths (1/m along the axis, 0 = infinity) at the pixel centres of a camera
/// without distortion.
using InverseDepthMap = Image<float>;

inline constexpr float kUnknownDepth = -1;  ///< the value of a pixel whose depth is unknown

/// Returns, for each block of kVisibilityBlock x kVisibilityBlock pixels, the nearest depth that
/// bilinear samples starting in it can read. These read the block, its right column and its lower
/// row.
InverseDepthMap block_nearest_depths(const InverseDepthMap& map);
inline constexpr int kVisibilityBlockLog2 = 3, kVisibilityBlock = 1 << kVisibilityBlockLog2;

/// Maps a pixel (x, y) with inverse planar depth q of one undistorted camera to another one: (X, Y,
/// W) = direction * (x, y, 1) + q * parallax. If W > 0, the other camera sees the point at pixel
/// (X/W, Y/W) with inverse planar depth q/W. Exact for points at infinity.
struct PixelTransfer {
  std::array<double, 9> direction{};  ///< row-major
  std::array<double, 3> parallax{};
};
PixelTransfer pixel_transfer(const VirtualCamera& to, const VirtualCamera& from);

}  // namespace raystage::render
