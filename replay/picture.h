// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "compose/layers/layer_image.h"
#include "compose/preview/display.h"
#include "compose/preview/false_color.h"
#include "compose/shot_color_spaces.h"
#include "schemas/viewer_message.h"
#include "store/jpeg/rgb_image.h"

namespace raystage::replay {

/// Returns the settings of a look for pictures in the colours of a shot.
compose::DisplayOptions display_options(const schemas::ViewerMessage::Look& look,
                                        const compose::ShotColorSpaces& colors);

/// Converts rendered views to pictures for a display. Thread-safe.
class PictureMaker {
 public:
  /// Throws Error (bad input) if the colour config has no such display or view.
  PictureMaker(const schemas::ViewerMessage::Look& look, const compose::ShotColorSpaces& colors);

  store::RgbImage make(const compose::LayerImage& image) const;

 private:
  schemas::ViewerMessage::Look look_;
  compose::DisplayTransform display_;
};

/// Marks pixels at sharp edges in red, as cameras show which parts are in focus: where the second
/// difference of the codes exceeds a threshold. `image`: that of the picture; transparent pixels
/// are not marked.
void mark_sharp_edges(const compose::LayerImage& image, store::RgbImage& picture);

}  // namespace raystage::replay
