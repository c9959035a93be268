// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "render/common/method.h"
#include "render/planar/aperture_lens.h"
#include "render/planar/focal_plane.h"

namespace raystage {

/// Fills RenderedView::cameras and nearest_ray of a view whose rays are shared by the cameras at
/// the corners of their cells, as render_focal_plane() or its reference has made it: the weights
/// are worked out again, pixel by pixel, in double.
void measure_planar_coverage(const ViewRequest& request, CornerWeights weights,
                             RenderedView& image);

/// The same for a view of which render_aperture() has made colour, alpha and depth.
void measure_aperture_coverage(const ViewRequest& request, const ApertureLens& lens,
                               RenderedView& image);

}  // namespace raystage
