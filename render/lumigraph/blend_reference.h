// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <vector>

#include "render/lumigraph/ray_weights.h"
#include "render/sampling/reference_renderer.h"

namespace raystage::render {

/// Returns R, G, B, A, premultiplied linear light, of the weighted cameras of a ray. A is the
/// largest `seen` of a camera times the mean alpha of the frames. Thread-safe.
std::array<float, 4> blend_reference(ReferenceFrames& frames,
                                     const std::vector<WeightedCamera>& cameras,
                                     const store::FrameCache& cache);

}  // namespace raystage::render
