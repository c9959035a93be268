// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

namespace raystage::render::plane_sweep {

/// Adds cameras' samples of a row's pixels to `sums`, except those of the outliers. Per pixel, the
/// camera whose colour is farthest (mean absolute difference of R, G, B) from the mean of the
/// remaining ones is excluded; of equals the first. This is done `excluded_cameras` times while
/// more than two remain. `samples`: per camera as many as `sums`, filled by add_samples_at_depth()
/// from 0. Cameras without weight at a pixel do not count there.
void add_inlier_samples(std::span<const float> samples, int excluded_cameras,
                        std::span<float> sums);

}  // namespace raystage::render::plane_sweep
