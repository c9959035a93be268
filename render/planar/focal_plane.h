// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include "render/common/method.h"
#include "render/planar/object_planes.h"

namespace raystage {

/// How the cameras at the corners of a ray's cell share it.
enum class CornerWeights {
  kLinear,  ///< 1 at a camera's own corner, 0 at the others, linear between
  kNearest  ///< all to the camera that the ray passes nearest to: cut from camera to camera
};

/// Focal plane reconstruction with three cameras a pixel, thesis 4.1.2: the triangles of the
/// array's topology are projected into the view; every camera's image is projected onto the focal
/// plane and weighted 1 at its own corner, 0 at the others, linear between; the three are added.
/// Radial and tangential distortion are corrected on the way. Fast: rows over TBB, SIMD kernels,
/// only the MCUs that contribute are decoded. `view` must have no distortion. `region`: the pixels
/// to render, the others stay as nobody saw them; null: all.
RenderedView render_focal_plane(const VirtualCamera& view, const LightFieldFrame& instant,
                                const Eigen::Vector4d& plane, CornerWeights weights,
                                bool count_needed_pixels, const ViewRegion* region = nullptr);

/// Returns what the cameras that this host holds contribute to render_focal_plane(): sums, one
/// plane.
Contribution contribute_focal_plane(const VirtualCamera& view, const LightFieldFrame& instant,
                                    const Eigen::Vector4d& plane, CornerWeights weights,
                                    bool count_needed_pixels, const ViewRegion* region = nullptr);

/// Returns the view of which all hosts' contributions have these `sums`.
RenderedView combine_focal_plane(const VirtualCamera& view, const LightFieldFrame& instant,
                                 const Eigen::Vector4d& plane, CornerWeights weights,
                                 PixelValues sums, const ViewRegion* region = nullptr);

/// The same, ray by ray in double with whole frames and CameraModel: slow and obvious, and good for
/// views with distortion too. Rays that meet `objects` are looked up on the nearest one's plane.
RenderedView render_focal_plane_reference(const VirtualCamera& view, const LightFieldFrame& instant,
                                          const Eigen::Vector4d& plane, CornerWeights weights,
                                          bool count_needed_pixels,
                                          std::span<const ObjectPlane> objects = {});

/// Both as methods to choose by name.
const Method& focal_plane_method();
const Method& nearest_method();

}  // namespace raystage
