// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>

#include "rig/fisheye_lens.h"

namespace raystage::render {

/// A fisheye lens as the kernels compute it: the distance per angle, distance(a) / a, is an even
/// function of the angle a, and a polynomial in s = 2 a^2 / largest^2 - 1, from -1 to 1.
struct FisheyeFit {
  static constexpr int kTerms = 12;
  std::array<float, kTerms> distance_per_angle{};  ///< of s, constant term first
  float per_largest_squared = 0;                   ///< 1 / (largest fitted angle, radians)^2
  /// Bounds the second derivative of the image point, focal lengths, along a great circle, per
  /// radian^2: an arc of the length l leaves its chord by at most bend * l^2 / 8.
  float bend = 0;
  float largest_slope = 0;  ///< bounds the first derivative, focal lengths per radian
};

/// Fits the polynomial at Chebyshev's nodes, up to the largest angle that the frame records: a lens
/// without a half angle may see farther than its sensor, and bounds over all of it are loose. For
/// lenses as they are sold the error is below 1e-7 of the distance, less than the rounding of
/// positions in float. `farthest`: of the frame's corners from the principal point, focal lengths.
FisheyeFit fit_fisheye(const rig::FisheyeLens& lens, double farthest);

}  // namespace raystage::render
