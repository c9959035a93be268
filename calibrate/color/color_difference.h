// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>

namespace raystage::calibrate {

/// CIE L*a*b* relative to the white of Rec.709 (D65).
struct Lab {
  double l = 0, a = 0, b = 0;
};

/// Converts linear light with Rec.709 primaries, full scale 1 (IEC 61966-2-1, CIE 15:2004).
Lab lab_from_linear(const std::array<double, 3>& rgb);

/// Returns the CIEDE2000 difference with kL = kC = kH = 1 (Sharma, Wu and Dalal 2005); about 1 is
/// just noticeable.
double color_difference(const Lab& one, const Lab& other);

}  // namespace raystage::calibrate
