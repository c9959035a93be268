// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

#include "compose/layers/layer_image.h"

namespace raystage::compose {

/// Order in which layers are composited.
enum class MergeOrder {
  kLayerOrder,  ///< each over those before it
  kDepth        ///< per pixel by depth, the farthest first; equal depths in layer order
};

/// A layer to be merged. All have one size.
struct MergedLayer {
  const LayerImage* image = nullptr;
  /// Attenuates the layers behind it by its alpha and is invisible itself.
  bool is_holdout = false;
};

/// Returns the composite of the layers ("over" of premultiplied colours: Porter and Duff,
/// "Compositing digital images", SIGGRAPH 1984): C = C_front + (1 - A_front) C_behind, alpha alike.
/// Z and AOVs of a pixel are those of the first sample from the front at which half of the pixel's
/// alpha is reached. Where A is 0 they are empty. Layers without an AOV are ignored for it. Ids,
/// which all layers have or none, are those of all visible objects with their visible shares.
/// `layers`: at least one, the rearmost first.
LayerImage merge(std::span<const MergedLayer> layers, MergeOrder order);

}  // namespace raystage::compose
