// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <limits>
#include <span>

#include "render/common/light_field_frame.h"
#include "render/common/world_ray.h"
#include "render/lumigraph/ray_weights.h"

namespace raystage::render {

struct RaySample {
  /// R, G, B, A: scene-linear Rec.709, premultiplied; A as in RenderedView.
  std::array<float, 4> rgba{};
  float coverage = 0;  ///< as in RenderedView
  /// Metres along the ray to the point at which it was looked up; infinity if A is 0.
  float depth = std::numeric_limits<float>::infinity();
  float cameras = 0;  ///< effective number of contributing cameras: (sum w)^2 / sum w^2
  /// Metres from the ray's line to the nearest contributing camera; infinity if there is none.
  float nearest_ray = std::numeric_limits<float>::infinity();
};

/// Looks up rays (directions of any length but 0) where they meet `surface`, by lumigraph weights.
/// Invalid rays (not finite or without direction) are unseen. Decodes the frames that contribute,
/// whole. Rays adjacent in the span should be adjacent in space. Multi-threaded; the samples do not
/// depend on the number of threads. Throws Error (bad input) if a frame cannot be read.
void query_rays(std::span<const WorldRay> rays, const LightFieldFrame& instant,
                const RaySurface& surface, const RayWeightOptions& weighing,
                std::span<RaySample> samples);

/// Looks up the rays one after the other, in double: the reference.
void query_rays_reference(std::span<const WorldRay> rays, const LightFieldFrame& instant,
                          const RaySurface& surface, const RayWeightOptions& weighing,
                          std::span<RaySample> samples);

}  // namespace raystage::render
