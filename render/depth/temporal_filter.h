// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>

#include "base/image.h"
#include "render/depth/inverse_depth_map.h"

namespace raystage::render {

using Luma = Image<std::uint8_t>;  ///< 8-bit codes

/// A camera's picture and depths at a temporal neighbour, of the size of those now.
struct TemporalNeighbour {
  const Luma* luma = nullptr;
  const InverseDepthMap* depths = nullptr;
};

/// Returns a camera's depths averaged with those of temporal neighbours where their picture is the
/// same: where nothing moved, or the neighbour was moved (temporal_motion.h). So surfaces do not
/// flicker, and others are not blurred into them. A neighbour's depth
/// has weight 1 if the mean absolute luma difference over kStaticWindowRadius pixels to each side
/// is at most kStaticLumaThreshold (of 255). The weight falls to 0 at twice that, and is multiplied
/// by 1 - |difference| / tolerance (1/m). Unknown depths stay unknown.
InverseDepthMap temporal_filter(const InverseDepthMap& depths, const Luma& luma,
                                std::span<const TemporalNeighbour> others, float tolerance);
inline constexpr int kStaticWindowRadius = 2;
inline constexpr float kStaticLumaThreshold = 2;

InverseDepthMap temporal_filter_reference(const InverseDepthMap& depths, const Luma& luma,
                                          std::span<const TemporalNeighbour> others,
                                          float tolerance);

}  // namespace raystage::render
