// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace raystage::render {

/// Identifies what a fragment is part of (thesis 4.1.4).
struct FragmentTag {
  std::uint32_t view = 0;   ///< identifies the request for a view that the fragment answers
  std::uint32_t layer = 0;  ///< index of the light field in the shot
  std::uint32_t plane = 0;  ///< index into Contribution::planes
  bool operator==(const FragmentTag&) const = default;
};

/// A rectangle of a view, pixels.
struct FragmentArea {
  int x = 0, y = 0;  ///< of the upper left pixel
  int width = 0, height = 0;
  std::size_t pixels() const { return static_cast<std::size_t>(width) * height; }
  bool operator==(const FragmentArea&) const = default;
};

/// Returns disjoint rectangles that cover every pixel of a view of which one of the four values is
/// not zero. `sums`: R, G, B, weight per pixel, row-major. The rectangles are kFragmentRows high or
/// a multiple of that, so that a slanted edge costs few pixels beyond it. Cost: one pass over
/// `sums`.
std::vector<FragmentArea> cover_nonzero_pixels(std::span<const float> sums, int width, int height);

/// Height of a strip of rows in which cover_nonzero_pixels() looks for columns, pixels.
inline constexpr int kFragmentRows = 8;
/// Runs of zero columns up to this length are sent, because they cost less than another rectangle.
inline constexpr int kMinGap = 16;

}  // namespace raystage::render
