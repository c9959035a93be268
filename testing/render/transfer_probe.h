// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "render/depth/inverse_depth_map.h"

namespace raystage::testing {

/// The result of RowTransfer, which the depth kernels use, for one pixel.
struct TransferredPixel {
  float u = 0, v = 0;       ///< pixels, if inside
  float inverse_depth = 0;  ///< 1/m, if inside
  bool inside = false;
};

/// Transfers pixel x of row y at an inverse depth (not negative) to an image of width x height,
/// within a vector of adjacent pixels. Run-time dispatch.
TransferredPixel probe_transfer(const render::PixelTransfer& transfer, int x, int y,
                                float inverse_depth, int width, int height);

const char* transfer_target();  ///< returns the name of the instruction set in use

}  // namespace raystage::testing
