// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <vector>

#include "store/jpeg/rgb_image.h"

namespace raystage::compose {

/// Returns images of one size in rows of `columns`, each with its frame number below.
store::RgbImage contact_sheet(std::span<const store::RgbImage> pictures,
                              std::span<const int> frames, int columns);

/// Returns at most `count` evenly spaced frames, including the first and the last.
std::vector<int> evenly_spaced_frames(std::span<const int> frames, int count);

}  // namespace raystage::compose
