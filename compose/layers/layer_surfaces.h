// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "compose/layers/layer_image.h"

namespace raystage::compose {

/// The image of a layer whose edges of depth show two surfaces, to be merged with other layers by
/// depth: what stands between the surfaces is then seen between them.
struct LayerSurfaces {
  LayerImage image;  ///< at edges: the surfaces in front
  /// The surfaces behind them at edges, transparent elsewhere. Colours are those of the part that
  /// is seen, until cover_behind(): the layer is the sum of both images. None: no edges.
  std::optional<LayerImage> behind = {};
};

/// Tells the surfaces of LayerImage::edges apart. Those behind have the layer's AOVs.
LayerSurfaces separate_surfaces(LayerImage image);

/// Makes the surfaces behind as opaque as they are behind the image as it is now, clipped and with
/// its opacity: it over them is the layer.
void cover_behind(LayerSurfaces& surfaces);

}  // namespace raystage::compose
