// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "render/common/view.h"

namespace raystage::render::plane_sweep {

/// Returns a picture's luminance (Rec. 709) for SemiGlobalOptions::guide, as 8-bit codes of the
/// sRGB curve, row-major; 0 for transparent pixels. `full_scale`: the light of code 255.
std::vector<std::uint8_t> edge_guide(const RenderedView& picture, double full_scale);

}  // namespace raystage::render::plane_sweep
