// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

#include "render/depth/inverse_depth_map.h"
#include "render/depth/matching_image.h"

namespace raystage::render {

/// A camera's matching image and depths at a temporal neighbour.
struct TemporalNeighbour {
  const MatchingImage* picture = nullptr;
  const InverseDepthMap* depths = nullptr;
};

/// Returns a camera's depths averaged with those of temporal neighbours where its picture has not
/// changed. So static surfaces do not flicker and moving ones are not blurred. A neighbour's depth
/// has weight 1 if the mean absolute luma difference over kStaticWindowRadius pixels to each side
/// is at most kStaticLumaThreshold (of 255). The weight falls to 0 at twice that, and is multiplied
/// by 1 - |difference| / tolerance (1/m). Unknown depths stay unknown.
InverseDepthMap temporal_filter(const InverseDepthMap& depths, const MatchingImage& picture,
                                std::span<const TemporalNeighbour> others, float tolerance);
inline constexpr int kStaticWindowRadius = 2;
inline constexpr float kStaticLumaThreshold = 2;

InverseDepthMap temporal_filter_reference(const InverseDepthMap& depths,
                                          const MatchingImage& picture,
                                          std::span<const TemporalNeighbour> others,
                                          float tolerance);

}  // namespace raystage::render
