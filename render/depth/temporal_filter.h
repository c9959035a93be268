// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

#include "render/depth/inverse_depth_map.h"
#include "render/depth/matching_image.h"

namespace raystage {

/// A camera's picture and depths at a temporal neighbour.
struct TemporalNeighbour {
  const MatchingImage* picture = nullptr;
  const InverseDepthMap* depths = nullptr;
};

/// A camera's depths, averaged with those of other instants where its picture has not changed: what
/// stands still does not shimmer, and what moves is left alone. Another instant's depth counts
/// fully where the mean absolute difference of luma over kStaticWindowRadius pixels to each side is
/// kStaticLumaThreshold (of 255) or less, falling to nothing at twice that; and by 1 - |difference|
/// / tolerance (1/m). Unknown depths stay unknown.
InverseDepthMap temporal_filter(const InverseDepthMap& depths, const MatchingImage& picture,
                                std::span<const TemporalNeighbour> others, float tolerance);
inline constexpr int kStaticWindowRadius = 2;
inline constexpr float kStaticLumaThreshold = 2;

/// The reference of temporal_filter().
InverseDepthMap temporal_filter_reference(const InverseDepthMap& depths,
                                          const MatchingImage& picture,
                                          std::span<const TemporalNeighbour> others,
                                          float tolerance);

}  // namespace raystage
