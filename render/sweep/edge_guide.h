// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "render/common/view.h"
#include "store/processing/frames/frame_matte.h"

namespace raystage::render::plane_sweep {

/// Returns a picture's luminance (Rec. 709) for SemiGlobalOptions::guide, as 8-bit codes of the
/// sRGB curve, row-major; 0 for transparent pixels. `scale`: of the frames; code 255 is full scale.
std::vector<std::uint8_t> edge_guide(const RenderedView& picture, const store::CodeScale& scale);

}  // namespace raystage::render::plane_sweep
