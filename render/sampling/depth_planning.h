// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "render/sampling/depth_sampling.h"

namespace raystage {

/// Pixels [left, right) x [top, bottom) of a view, seen at inverse depths from `nearest` down to
/// `farthest` (1/m along the view's axis, from the source's reference, farthest <= nearest).
struct ViewBlock {
  int left = 0, right = 0, top = 0, bottom = 0;
  double farthest = 0, nearest = 0;
};

/// Marks in the camera's wanted_mcus (see set_mcu_layout()) all that look-ups at the block's pixel
/// centres can read, whatever their depths within the range: never too little, for any lens. Where
/// the block reaches behind the camera, the whole frame. Many threads may mark the same frame.
void mark_block(const DepthSource& source, const ViewBlock& block, Interpolation interpolation);

}  // namespace raystage
