// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

#include "compose/layers/layer_image.h"

namespace raystage {

/// How layers are put together.
enum class MergeOrder {
  kStated,  ///< each over those before it
  kDepth    ///< at every pixel the farther first; at one depth as stated
};

/// A layer to be merged, all of one size.
struct MergedLayer {
  const LayerImage* image = nullptr;
  /// Cuts what lies behind it by its alpha, and shows nothing of itself: its place is filled by
  /// something that is composited later.
  bool is_holdout = false;
};

/// "Over" of premultiplied colours (Porter and Duff, "Compositing digital images", SIGGRAPH 1984):
/// C = C_front + (1 - A_front) C_behind, for alphas, too. Z and AOVs are those of the sample behind
/// which less than half of the pixel's alpha lies: where A is 0, of none. A layer that lacks an AOV
/// says nothing of it. Ids, which all layers have or none, are all that is seen, each object with
/// what is seen of it. `layers`: at least one, the rearmost first.
LayerImage merge(std::span<const MergedLayer> layers, MergeOrder order);

/// The slow, obvious way: pixel by pixel, all samples in a list.
LayerImage merge_reference(std::span<const MergedLayer> layers, MergeOrder order);

}  // namespace raystage
