// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

#include "render/depth/matching_image.h"
#include "render/depth/pinhole.h"

namespace raystage {

/// A camera at another instant: what it shows, and its depths then.
struct OtherInstant {
  const MatchingImage* picture = nullptr;
  const InverseDepthMap* depths = nullptr;
};

/// A camera's depths, averaged with those of other instants where its picture has not changed: what
/// stands still does not shimmer, and what moves is left alone. Another instant's depth counts
/// fully where the mean absolute difference of luma over kStillReach pixels to each side is
/// kStillCodes (of 255) or less, falling to nothing at twice that; and by 1 - |difference| /
/// tolerance (1/m). Unknown depths stay unknown.
InverseDepthMap steadied(const InverseDepthMap& depths, const MatchingImage& picture,
                         std::span<const OtherInstant> others, float tolerance);
inline constexpr int kStillReach = 2;
inline constexpr float kStillCodes = 2;

/// The slow, obvious way.
InverseDepthMap steadied_reference(const InverseDepthMap& depths, const MatchingImage& picture,
                                   std::span<const OtherInstant> others, float tolerance);

}  // namespace raystage
