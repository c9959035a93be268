// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>

#include "schemas/photometric_response.h"

namespace raystage::rig {

inline constexpr int kChartColumns = 6, kChartRows = 4;
inline constexpr int kChartPatches = kChartColumns * kChartRows;
inline constexpr int kFirstNeutralPatch = 18;  ///< white; four greys and black follow
using PatchColors = std::array<schemas::Rgb, kChartPatches>;

/// Returns the reflectances of a ColorChecker Classic, row by row from dark skin, as linear light
/// with Rec.709 primaries and white. 1 is a perfect white; cyan's red is below 0. Source: X-Rite's
/// L*a*b* of charts made since November 2014 (D50, 2 degrees), adapted to D65 (Bradford).
PatchColors color_checker_reference();

}  // namespace raystage::rig
