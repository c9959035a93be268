// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <limits>
#include <span>

#include "render/common/light_field_frame.h"
#include "render/common/world_ray.h"
#include "render/lumigraph/ray_weights.h"

namespace raystage {

/// What a light field knows of a ray.
struct RaySample {
  /// R, G, B, A: scene-linear Rec.709, premultiplied; A as in RenderedView.
  std::array<float, 4> rgba{};
  float coverage = 0;  ///< as in RenderedView
  /// Metres along the ray to the surface on which it was looked up; infinity where A is 0.
  float depth = std::numeric_limits<float>::infinity();
  float cameras = 0;  ///< effective number behind it: (sum w)^2 / sum w^2
  /// Metres, least distance from the ray's line to the centre of a camera that contributes;
  /// infinity where none does.
  float nearest_ray = std::numeric_limits<float>::infinity();
};

/// Answers rays (directions of any length but 0) into as many `samples`, by lumigraph weights where
/// they meet `surface`. Rays that are not finite or have no direction are seen by nobody. Frames
/// are decoded whole, those that contribute only. Neighbours in the span should be neighbours in
/// space. Threads share the rays; the samples do not depend on how many there are. Throws Error
/// (bad input) for frames that cannot be read.
void query_rays(std::span<const WorldRay> rays, const LightFieldFrame& instant,
                const RaySurface& surface, const RayWeightSettings& weighing,
                std::span<RaySample> samples);

/// One ray after the other, in double.
void query_rays_reference(std::span<const WorldRay> rays, const LightFieldFrame& instant,
                          const RaySurface& surface, const RayWeightSettings& weighing,
                          std::span<RaySample> samples);

}  // namespace raystage
