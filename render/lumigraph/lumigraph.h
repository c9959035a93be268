// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include "render/common/method.h"
#include "render/common/world_ray.h"
#include "render/lumigraph/ray_weights.h"

namespace raystage {

/// Whether weights are worked out for every pixel, or at the corners of tiles of kBlendingTileSize
/// pixels and interpolated between (Buehler et al. 2001, section 4): faster, and wrong where a tile
/// reaches across the border of an image or an edge of the proxy.
enum class WeightField { kPerPixel, kBlendingField };

inline constexpr int kBlendingTileSize = 16;

/// What a ray that does not meet the surface is: seen by nobody, or known to meet nothing
/// (RenderedView::empty_space).
enum class MissedRay { kUnseen, kKnownEmpty };

/// Unstructured lumigraph: each ray is looked up where it meets `surface`, in the few cameras that
/// suit it best (see RayWeightSettings). A = the largest share of it that a camera sees, coverage
/// lower by the weight that cameras absent at this instant would have had. `request`'s options are
/// not read. The view must have no lens distortion. Threads share rows of blocks of 64 x 16 pixels;
/// per block only cameras are looked at that can count there. Memory: 8 bytes a pixel of a band of
/// blocks, as high as fits ViewRequest::working_bytes, the frames' masks, and what FrameCache
/// holds. How high has no say in the pixels.
RenderedView render_lumigraph(const ViewRequest& request, const RaySurface& surface,
                              const RayWeightSettings& weighing, WeightField field,
                              MissedRay missed = MissedRay::kUnseen);

/// Returns what the cameras that this host holds contribute to render_lumigraph(): sums, one plane.
Contribution contribute_lumigraph(const ViewRequest& request, const RaySurface& surface,
                                  const RayWeightSettings& weighing, WeightField field);

/// Returns the view of which all hosts' contributions have these `sums`.
RenderedView combine_lumigraph(const ViewRequest& request, const RaySurface& surface,
                               const RayWeightSettings& weighing, WeightField field,
                               PixelValues sums);

/// Ray by ray in double; any view; weights always per pixel.
RenderedView render_lumigraph_reference(const ViewRequest& request, const RaySurface& surface,
                                        const RayWeightSettings& weighing,
                                        MissedRay missed = MissedRay::kUnseen);

}  // namespace raystage
