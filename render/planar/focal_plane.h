// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include "render/common/method.h"
#include "render/planar/object_planes.h"

namespace raystage::render {

/// Selects how a ray is blended from the cameras at the corners of its cell.
enum class CornerWeights {
  kLinear,  ///< 1 at a camera's own corner, 0 at the others, linear in between
  kNearest  ///< only the camera nearest to the ray: discontinuous between cameras
};

/// Renders a view per ray in double with whole frames and CameraModel, also with distortion: the
/// reference. Rays that meet `objects` are sampled on the nearest object's plane.
RenderedView render_focal_plane_reference(const ViewRequest& request, CornerWeights weights,
                                          std::span<const ObjectPlane> objects = {});

/// Returns the focal plane reconstruction from three cameras per pixel, thesis 4.1.2. The triangles
/// of the array's topology are projected into the view. Every camera's image is projected onto the
/// focal plane and weighted 1 at its own corner, 0 at the others, linear in between; the three are
/// added. Radial and tangential distortion are corrected. Rows run in parallel with SIMD kernels,
/// and only the MCUs that contribute are decoded.
const Method& focal_plane_method();
/// Returns the same method with CornerWeights::kNearest.
const Method& nearest_method();

}  // namespace raystage::render
