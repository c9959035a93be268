// SPDX-License-Identifier: Apache-2.0
// Excludes outlier cameras per pixel of a row and sums the samples of the others; see
// add_inlier_samples(). Input and output: premultiplied R, G, B and weight. Cost: O(pixels x
// cameras x excluded cameras). The matching costs do the same (cost_kernels.cpp).
#include "render/sweep/inlier_selection.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

namespace raystage::render::plane_sweep {
namespace {

/// Returns the sample farthest from the mean colour. A sample: R, G, B and 1, times its weight.
const float* farthest_from_mean(std::span<const float* const> counting) {
  float mean[3] = {};
  for (const float* sample : counting)
    for (int c = 0; c < 3; ++c) mean[c] += sample[c] / sample[3];
  const auto count = static_cast<float>(counting.size());
  const float* farthest = nullptr;
  float most = -1;
  for (const float* sample : counting) {
    float off = 0;
    for (int c = 0; c < 3; ++c) off += std::abs(sample[c] / sample[3] - mean[c] / count);
    if (off > most) {
      most = off;
      farthest = sample;
    }
  }
  return farthest;
}

}  // namespace

void add_inlier_samples(std::span<const float> samples, int excluded_cameras,
                        std::span<float> sums) {
  std::vector<const float*> counting;
  for (std::size_t at = 0; at < sums.size(); at += 4) {
    counting.clear();
    for (std::size_t i = at; i < samples.size(); i += sums.size()) {
      if (samples[i + 3] > 0) counting.push_back(&samples[i]);
    }
    for (int i = 0; i < excluded_cameras && counting.size() > 2; ++i) {
      std::erase(counting, farthest_from_mean(counting));
    }
    for (const float* sample : counting) {
      for (std::size_t c = 0; c < 4; ++c) sums[at + c] += sample[c];
    }
  }
}

}  // namespace raystage::render::plane_sweep
