// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "render/sampling/source_view.h"

namespace raystage::render {

/// Pixels [x_begin, x_end) x [y_begin, y_end) of a view.
struct PixelBlock {
  int x_begin = 0, x_end = 0, y_begin = 0, y_end = 0;
};

/// Marks the MCUs of a camera's frame that samples for a block of the view's pixels may read. These
/// are all that mark_run() would mark and few more, in a hundredth of the time. Many threads may
/// mark the same frame. `source.wanted_mcus` must not be null.
///
/// A plane's projection takes the block to a convex quadrilateral, which lies within the box around
/// its corners. A lens bends it, so the box is enlarged by a bound. With the corners p_i and a
/// point p = sum w_i p_i in between, D(p) differs from sum w_i D(p_i) by at most
///   M/2 sum w_i |p_i - p|^2 <= M/6 diameter^2,
/// where M bounds the second derivative of the distortion D. Blocks whose box is much larger than
/// they are, or that reach beyond the camera's horizon, are halved.
void mark_block(const SourceView& source, const PixelBlock& block);

}  // namespace raystage::render
