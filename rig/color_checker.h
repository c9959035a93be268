// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>

#include "schemas/photometric_response.h"

namespace raystage {

inline constexpr int kChartColumns = 6, kChartRows = 4;
inline constexpr int kChartPatches = kChartColumns * kChartRows;
inline constexpr int kFirstNeutralPatch = 18;  ///< from here on: white, four greys, black
using PatchColors = std::array<Rgb, kChartPatches>;

/// Returns the reflectances of a ColorChecker Classic, row by row from dark skin: linear light,
/// Rec.709 primaries and white, 1 = a perfect white; cyan has a red below 0. X-Rite's values for
/// charts made since November 2014 (CIE L*a*b*, D50, 2 degrees), adapted from D50 to D65
/// (Bradford).
PatchColors color_checker_reference();

}  // namespace raystage
