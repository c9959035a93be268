// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include "render/common/method.h"
#include "render/common/world_ray.h"
#include "render/lumigraph/ray_weights.h"

namespace raystage::render {

/// Selects whether weights are computed for every pixel, or at the corners of tiles of
/// kBlendingTileSize pixels and interpolated (Buehler et al. 2001, section 4). The latter is
/// faster, but wrong where a tile crosses the border of an image or an edge of the proxy.
enum class WeightField { kPerPixel, kBlendingField };

inline constexpr int kBlendingTileSize = 16;

/// Selects how a ray that misses the surface counts: as unseen, or as empty
/// (RenderedView::empty_space).
enum class MissedRay { kUnseen, kKnownEmpty };

/// Returns a view by the unstructured lumigraph: each ray is looked up where it meets `surface`, in
/// the few best cameras (see RayWeightOptions). A = the largest `seen` of these cameras; coverage
/// is A less the weights that cameras absent at this instant would have. Does not read `request`'s
/// options. The view must have no lens distortion. Threads share rows of blocks of 64 x 16 pixels;
/// a block considers only cameras that can count in it. Memory: 8 bytes per pixel of a band of
/// blocks, as high as fits ViewRequest::working_bytes, the frames' masks, and the FrameCache. The
/// height of the band does not change the pixels.
RenderedView render_lumigraph(const ViewRequest& request, const RaySurface& surface,
                              const RayWeightOptions& weighing, WeightField field,
                              MissedRay missed = MissedRay::kUnseen);

/// Returns the contribution of this host's cameras to render_lumigraph(): sums, one plane.
Contribution contribute_lumigraph(const ViewRequest& request, const RaySurface& surface,
                                  const RayWeightOptions& weighing, WeightField field);

/// Returns the view from `sums`, the contributions of all hosts.
RenderedView combine_lumigraph(const ViewRequest& request, const RaySurface& surface,
                               const RayWeightOptions& weighing, WeightField field,
                               PixelValues sums);

/// Renders the same ray by ray in double, for any view, with weights always per pixel: the
/// reference.
RenderedView render_lumigraph_reference(const ViewRequest& request, const RaySurface& surface,
                                        const RayWeightOptions& weighing,
                                        MissedRay missed = MissedRay::kUnseen);

}  // namespace raystage::render
