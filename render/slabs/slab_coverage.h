// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

#include "render/common/ray_coverage.h"
#include "render/slabs/slabs.h"

namespace raystage::render {

/// A camera behind a ray. A camera in several nodes counts once, with the sum of its weights.
struct RayCamera {
  int camera = 0;
  double weight = 0;
};
RayCoverage measure_ray_coverage(std::span<const RayCamera> cameras, const ViewRequest& request,
                                 const Eigen::Vector3d& ray);

/// Fills RenderedView::cameras and nearest_ray of a view of slabs: the cameras of the nodes around
/// each ray are determined again per pixel, in double.
void measure_slab_coverage(const ViewRequest& request, const RigSlabs& slabs, RenderedView& image);

}  // namespace raystage::render
