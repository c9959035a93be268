// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "render/common/view.h"

namespace raystage::render {

/// Makes a view opaque by pull and push (Gortler, Grzeszczuk, Szeliski and Cohen, "The Lumigraph",
/// SIGGRAPH 1996, section 3.4), with alpha as the confidence in a pixel.
///
/// Pull: each level of a pyramid has half the width and height, down to one pixel. A coarse pixel
/// is the sum of 4 x 4 fine pixels with weights 1 : 3 : 3 : 1 per axis; the weights of each fine
/// pixel sum to 1. Confidences above 1 are scaled to 1. Push: from the coarsest level down, a pixel
/// of confidence A is added to 1 - A times the coarser level, interpolated linearly.
///
/// Changes `rgba` only (see fill_behind_edges()). Alpha becomes 1 everywhere, except in empty space
/// (RenderedView::empty_space), which stays transparent; if no pixel was seen at all, it stays 0.
/// Pixels with alpha 1 stay bit-identical. Coverage and z still show the holes. Memory: a third of
/// rgba's. The bytes do not depend on the number of threads.
void fill_push_pull(RenderedView& view);

/// Does the same as fill_push_pull(), pixel by pixel in double and level by level recursively: the
/// reference.
void fill_push_pull_reference(RenderedView& view);

/// Adds what was filled at pixels of two surfaces to what is behind (RenderedView::edges), so that
/// the front over it is the filled pixel.
void fill_behind_edges(RenderedView& view);

/// Sums with less confidence than this contain no usable colour: they are not divided by it.
inline constexpr float kMinConfidence = 1e-20F;

}  // namespace raystage::render
