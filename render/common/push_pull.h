// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "render/common/view.h"

namespace raystage {

/// Makes a view opaque by pull and push (Gortler, Grzeszczuk, Szeliski and Cohen, "The Lumigraph",
/// SIGGRAPH 1996, section 3.4), with alpha as the confidence in a pixel.
///
/// Pull: each level of a pyramid has half the width and height, down to one pixel; a coarse pixel
/// is the sum of the 4 x 4 fine ones around it, weighted 1 : 3 : 3 : 1 each way so that every fine
/// pixel gives away 1 in total, cut back to a confidence of 1 where it is more. Push: from the
/// coarsest level down, a pixel of confidence A keeps what it has and takes 1 - A from the level
/// above, interpolated linearly.
///
/// Changes `rgba` only: alpha becomes 1 everywhere but where nothing is there
/// (RenderedView::empty_space), which stays as transparent, or stays 0 everywhere where no pixel
/// was seen at all. Where alpha was 1 nothing changes, by no bit. Coverage and z still show the
/// holes. Memory: a third of rgba's. The same bytes for any number of threads.
void fill_push_pull(RenderedView& view);

/// The same pixel by pixel in double, one level inside the other.
void fill_push_pull_reference(RenderedView& view);

/// Sums with less confidence than this hold no colour worth dividing by it.
inline constexpr float kMinConfidence = 1e-20F;

}  // namespace raystage
