// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "render/common/view.h"

namespace raystage::render {

/// Selects what the sampling kernels do with the sums of weighted samples of a pixel.
enum class SumStage {
  kSampleAndFinish,  ///< sample the cameras and write finished pixels
  /// Sample the cameras and write the sums: R, G, B, weight in codes of the blend space.
  kSampleOnly,
  kFinishOnly  ///< sample no camera: finish the sums that are there instead of the pixels
};

/// The contribution of one rank's cameras to a view (thesis 4.1.2): the sums of their weighted
/// samples. Summed over all ranks and finished, contributions are the view.
struct Contribution {
  /// Per plane on which rays are sampled: R, G, B, weight per pixel in codes of the blend space
  /// (65535 is full scale), row-major; 0 where the rank's cameras contribute nothing.
  std::vector<PixelValues> planes;
  RenderStatistics statistics;
  std::vector<std::string> notes;  ///< as RenderedView::notes
};

}  // namespace raystage::render
