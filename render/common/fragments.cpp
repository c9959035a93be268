// SPDX-License-Identifier: Apache-2.0
// Covers the pixels of a view that are not zero with rectangles (the fragments of thesis 4.1.4).
// Strips of kFragmentRows rows are cut into intervals of columns, and gaps narrower than kMinGap
// are closed. An interval that the strip above has too continues that rectangle.
#include "render/common/fragments.h"

#include <algorithm>
#include <cassert>

namespace raystage::render {
namespace {

struct Interval {
  int begin = 0, end = 0;
};

/// Marks the columns of rows [top, bottom) that hold a value other than zero.
void mark_columns(std::span<const float> sums, int width, int top, int bottom,
                  std::vector<std::uint8_t>& is_used) {
  std::ranges::fill(is_used, std::uint8_t{0});
  for (int y = top; y < bottom; ++y) {
    const float* row = sums.data() + static_cast<std::size_t>(y) * width * 4;
    for (int x = 0; x < width; ++x) {
      const float* pixel = row + static_cast<std::ptrdiff_t>(x) * 4;
      const bool used = pixel[0] != 0 || pixel[1] != 0 || pixel[2] != 0 || pixel[3] != 0;
      is_used[x] |= static_cast<std::uint8_t>(used);
    }
  }
}

std::vector<Interval> intervals_of(const std::vector<std::uint8_t>& is_used) {
  std::vector<Interval> intervals;
  const int width = static_cast<int>(is_used.size());
  for (int x = 0; x < width; ++x) {
    if (is_used[x] == 0) continue;
    if (!intervals.empty() && x - intervals.back().end < kMinGap) {
      intervals.back().end = x + 1;
    } else {
      intervals.push_back({x, x + 1});
    }
  }
  return intervals;
}

}  // namespace

std::vector<FragmentArea> cover_nonzero_pixels(std::span<const float> sums, int width, int height) {
  assert(sums.size() == static_cast<std::size_t>(width) * height * 4);
  std::vector<FragmentArea> areas;
  std::vector<std::size_t> above;  // areas that end where the strip begins
  std::vector<std::uint8_t> is_used(width);
  for (int top = 0; top < height; top += kFragmentRows) {
    const int bottom = std::min(top + kFragmentRows, height);
    mark_columns(sums, width, top, bottom, is_used);
    std::vector<std::size_t> here;
    for (const Interval& interval : intervals_of(is_used)) {
      const auto same = std::ranges::find_if(above, [&](std::size_t i) {
        return areas[i].x == interval.begin && areas[i].width == interval.end - interval.begin;
      });
      if (same != above.end()) {
        areas[*same].height += bottom - top;
        here.push_back(*same);
      } else {
        here.push_back(areas.size());
        areas.push_back({interval.begin, top, interval.end - interval.begin, bottom - top});
      }
    }
    above = std::move(here);
  }
  return areas;
}

}  // namespace raystage::render
