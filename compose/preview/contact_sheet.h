// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <vector>

#include "store/jpeg/rgb_image.h"

namespace raystage {

/// Pictures of one size side by side, row by row, each with its frame number below.
RgbImage contact_sheet(std::span<const RgbImage> pictures, std::span<const int> frames,
                       int columns);

/// `count` of `frames`, evenly spread, the first and the last among them (all, where there are no
/// more).
std::vector<int> evenly_spaced_frames(std::span<const int> frames, int count);

}  // namespace raystage
