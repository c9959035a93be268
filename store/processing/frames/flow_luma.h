// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "store/processing/frames/frame_matte.h"
#include "store/processing/motion/optical_flow.h"

namespace raystage::store {

/// Returns the 8-bit code of each of the 65536 levels of a scale, from which motion is estimated:
/// sRGB codes, of BlendSpace::kHighRange matching_code().
std::vector<std::uint8_t> flow_codes(const CodeScale& scale);

/// Returns the luma of the codes of levels, R, G, B, A per pixel, as make_flow_image().
Luma flow_luma(std::span<const std::uint16_t> rgba, int width, int height,
               std::span<const std::uint8_t> codes);

}  // namespace raystage::store
