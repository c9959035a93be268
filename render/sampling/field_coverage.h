// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <functional>

#include "render/common/blending_field.h"
#include "render/common/method.h"

namespace raystage {

/// How much a camera sees of a point, 0 to 1: nothing if something hides it. The point, at an
/// inverse planar depth (1/m) of the view, lies along `towards` from the camera's centre (in the
/// world; times the inverse depth, so finite for points at infinity).
using PointVisibility =
    std::function<double(int camera, const Eigen::Vector3d& towards, double inverse_depth)>;

/// Fills RenderedView::cameras and nearest_ray of a view whose rays are shared by the cameras of
/// `field` at the depths that it has: the weights are worked out again, pixel by pixel, in double.
/// `visible` may be empty: nothing hides anything. Where all cameras of a pixel are hidden, all
/// count.
void measure_view_coverage(const ViewRequest& request, const BlendingField& field,
                           const PointVisibility& visible, RenderedView& image);

/// The view of a scene that lies nowhere in it: transparent, of no camera, where that is asked for.
RenderedView transparent_view(const ViewRequest& request);

}  // namespace raystage
