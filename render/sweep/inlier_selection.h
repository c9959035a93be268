// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

namespace raystage::plane_sweep {

/// Adds cameras' samples of a row's pixels to `sums`, but for those that agree least: at each pixel
/// `excluded_cameras` times the camera whose colour is farthest (mean absolute difference of R, G,
/// B) from the mean colour of those that still count, the first of equals, as long as more than two
/// count. `samples`: camera by camera as many as `sums`, which add_samples_at_depth() filled from
/// 0; a camera without weight at a pixel does not count there.
void add_inlier_samples(std::span<const float> samples, int excluded_cameras,
                        std::span<float> sums);

}  // namespace raystage::plane_sweep
