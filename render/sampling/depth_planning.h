// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "render/sampling/depth_sampling.h"

namespace raystage::render {

/// Pixels [left, right) x [top, bottom) of a view, seen at inverse depths from `nearest` down to
/// `farthest` (farthest <= nearest). These are in 1/m along the view's axis, from the source's
/// reference.
struct ViewBlock {
  int left = 0, right = 0, top = 0, bottom = 0;
  double farthest = 0, nearest = 0;
};

/// Marks in the camera's wanted_mcus (see set_mcu_layout()) all MCUs that samples at the block's
/// pixel centres may read, for any depth within the range. Never marks too few, for any lens. Marks
/// the whole frame where the block reaches behind the camera. Many threads may mark the same frame.
void mark_block(const DepthSource& source, const ViewBlock& block, Interpolation interpolation);

}  // namespace raystage::render
