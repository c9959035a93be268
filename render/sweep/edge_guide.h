// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "render/common/view.h"

namespace raystage::plane_sweep {

/// Where a picture has edges, for SemiGlobalSettings::guide: its luminance (Rec. 709) as 8-bit
/// codes of sRGB's curve, row-major; 0 where nothing is seen. `full_scale`: the light of code 255.
std::vector<std::uint8_t> edge_guide(const RenderedView& picture, double full_scale);

}  // namespace raystage::plane_sweep
