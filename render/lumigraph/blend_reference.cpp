// SPDX-License-Identifier: Apache-2.0
// Reference of blend_chunk() (ray_chunk_kernels.cpp) for one ray, in double: the mean of the
// bilinear samples of the cameras by their weights, times the largest `seen`. Input: weighted
// cameras. Output: R, G, B, A, premultiplied linear light. Cost: O(cameras).
#include "render/lumigraph/blend_reference.h"

#include <algorithm>

namespace raystage::render {

std::array<float, 4> blend_reference(ReferenceFrames& frames,
                                     const std::vector<WeightedCamera>& cameras,
                                     const store::FrameCache& cache) {
  std::array<double, 3> mean{};
  double alpha = 0, seen = 0;
  for (const WeightedCamera& camera : cameras) {
    seen = std::max(seen, camera.seen);
    if (camera.weight == 0) continue;
    const FrameSample sample = frames.sample(static_cast<std::size_t>(camera.camera), camera.pixel);
    for (std::size_t c = 0; c < 3; ++c) mean[c] += camera.weight * sample.rgb[c];
    alpha += camera.weight * sample.alpha;
  }
  if (!(alpha > 0)) return {};
  for (double& value : mean) value /= alpha;
  return premultiplied_light(mean, seen * alpha, cache);
}

}  // namespace raystage::render
