// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "render/depth/inverse_depth_map.h"

namespace raystage::testing {

/// What RowTransfer, which the kernels of depth stand on, makes of a pixel.
struct TransferredPixel {
  float u = 0, v = 0;       ///< pixels, if inside
  float inverse_depth = 0;  ///< 1/m, if inside
  bool inside = false;
};

/// Of pixel x of row y at an inverse depth (0 or more), into an image of a size, amid the pixels
/// that a vector holds. Run-time dispatch.
TransferredPixel probe_transfer(const PixelTransfer& transfer, int x, int y, float inverse_depth,
                                int width, int height);

/// The instruction set in use.
const char* transfer_target();

}  // namespace raystage::testing
