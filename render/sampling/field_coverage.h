// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <functional>

#include "render/common/blending_field.h"
#include "render/common/method.h"

namespace raystage::render {

/// Returns the visibility of a point for a camera, 0 to 1; 0 if the point is occluded. The point
/// has an inverse planar depth (1/m) in the view. `towards` is its direction from the camera's
/// centre in the world, scaled by the inverse depth so that it is finite for points at infinity.
using PointVisibility =
    std::function<double(int camera, const Eigen::Vector3d& towards, double inverse_depth)>;

/// Fills RenderedView::cameras and nearest_ray of a view that blends the cameras of `field` at the
/// view's depths. The weights are computed again per pixel, in double. An empty `visible` means no
/// occlusion. Where all cameras of a pixel are occluded, all count.
void measure_view_coverage(const ViewRequest& request, const BlendingField& field,
                           const PointVisibility& visible, RenderedView& image);

/// Returns a view that shows nothing of the scene: transparent, with no cameras in the requested
/// coverage.
RenderedView transparent_view(const ViewRequest& request);

}  // namespace raystage::render
