// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Imath/half.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>

#include "compose/exr/exr_file.h"

namespace raystage::testing {

/// Returns the distance of two halves in units in the last place.
inline int half_steps(float a, float b) {
  const auto ordered = [](float value) {
    const int bits = Imath::half(value).bits();
    return bits < 0x8000 ? bits : 0x8000 - bits;
  };
  return std::abs(ordered(a) - ordered(b));
}

/// The difference of two pictures in R, G, B and A.
struct FrameDifference {
  int most = 0;         ///< maximum, in units in the last place of half
  int most_alpha = 0;   ///< maximum of A, in the same units
  double share = 0;     ///< of values that differ
  double psnr_db = 99;  ///< full scale 1
  float brightest = 0;  ///< largest value of the first picture
};

inline FrameDifference frame_difference(const std::filesystem::path& a,
                                        const std::filesystem::path& b) {
  const compose::ExrImage left = compose::read_exr(a), right = compose::read_exr(b);
  FrameDifference found;
  if (left.rgba.size() != right.rgba.size()) return {1 << 16, 1 << 16, 1, 0, 0};
  double squares = 0;
  for (std::size_t i = 0; i < left.rgba.size(); ++i) {
    const int steps = half_steps(left.rgba[i], right.rgba[i]);
    found.most = std::max(found.most, steps);
    if (i % 4 == 3) found.most_alpha = std::max(found.most_alpha, steps);
    if (steps > 0) found.share += 1.0 / static_cast<double>(left.rgba.size());
    squares += std::pow(double{left.rgba[i]} - double{right.rgba[i]}, 2);
    found.brightest = std::max(found.brightest, left.rgba[i]);
  }
  const double mean = squares / static_cast<double>(left.rgba.size());
  if (mean > 0) found.psnr_db = -10 * std::log10(mean);
  return found;
}

}  // namespace raystage::testing
