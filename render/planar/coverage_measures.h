// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "render/common/method.h"
#include "render/planar/aperture_lens.h"
#include "render/planar/focal_plane.h"

namespace raystage::render {

/// Fills RenderedView::cameras and nearest_ray of a view of focal_plane or nearest, or of their
/// reference. Their rays are blended from the cameras at the corners of their cells. The weights
/// are computed again per pixel, in double.
void measure_planar_coverage(const ViewRequest& request, CornerWeights weights,
                             RenderedView& image);

/// Fills the same values of a view of aperture with colour, alpha and depth.
void measure_aperture_coverage(const ViewRequest& request, const ApertureLens& lens,
                               RenderedView& image);

}  // namespace raystage::render
