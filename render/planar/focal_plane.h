// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include "render/common/method.h"
#include "render/planar/object_planes.h"

namespace raystage {

/// How a ray is blended from the cameras at the corners of its cell.
enum class CornerWeights {
  kLinear,  ///< 1 at a camera's own corner, 0 at the others, linear in between
  kNearest  ///< only the camera nearest to the ray: discontinuous between cameras
};

/// Focal plane reconstruction from three cameras per pixel, thesis 4.1.2. The triangles of the
/// array's topology are projected into the view. Every camera's image is projected onto the focal
/// plane and weighted 1 at its own corner, 0 at the others, linear in between; the three are added.
/// Radial and tangential distortion are corrected. Rows run in parallel with SIMD kernels, and only
/// the MCUs that contribute are decoded. `view` must have no distortion. `region`: the pixels to
/// render, the others stay unseen; null: all.
RenderedView render_focal_plane(const VirtualCamera& view, const LightFieldFrame& instant,
                                const Eigen::Vector4d& plane, CornerWeights weights,
                                bool count_needed_pixels, const ViewRegion* region = nullptr);

/// Returns the contribution of this rank's cameras to render_focal_plane(): sums, one plane.
Contribution contribute_focal_plane(const VirtualCamera& view, const LightFieldFrame& instant,
                                    const Eigen::Vector4d& plane, CornerWeights weights,
                                    bool count_needed_pixels, const ViewRegion* region = nullptr);

/// Returns the view for `sums`, the sum of all ranks' contributions.
RenderedView combine_focal_plane(const VirtualCamera& view, const LightFieldFrame& instant,
                                 const Eigen::Vector4d& plane, CornerWeights weights,
                                 PixelValues sums, const ViewRegion* region = nullptr);

/// Renders as render_focal_plane(), per ray in double with whole frames and CameraModel: the
/// reference, also for views with distortion. Rays that meet `objects` are sampled on the nearest
/// object's plane.
RenderedView render_focal_plane_reference(const ViewRequest& request, CornerWeights weights,
                                          std::span<const ObjectPlane> objects = {});

/// The methods by name.
const Method& focal_plane_method();
const Method& nearest_method();

}  // namespace raystage
