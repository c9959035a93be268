// SPDX-License-Identifier: Apache-2.0
// Moves a camera's picture and depths of another time along optical flow, so that the average over
// time also finds the depths of what moves. Wrong flow does no harm: there the pictures differ, and
// temporal_filter() leaves the neighbour out. Inverse depths in 1/m. Cost: that of the flow,
// O(pixels).
#include "render/depth/temporal_motion.h"

#include <array>
#include <cmath>
#include <utility>

#include "base/parallel.h"

namespace raystage::render {
namespace {

/// Returns the bilinear luma; 0 outside of the picture or where a pixel is unknown.
std::uint8_t luma_at(const store::Luma& luma, float x, float y) {
  const int left = static_cast<int>(std::floor(x)), top = static_cast<int>(std::floor(y));
  if (!luma.contains(left, top) || !luma.contains(left + 1, top + 1)) return 0;
  const std::array<std::uint8_t, 4> four{luma.at(left, top), luma.at(left + 1, top),
                                         luma.at(left, top + 1), luma.at(left + 1, top + 1)};
  for (const std::uint8_t code : four) {
    if (code == 0) return 0;
  }
  const float right = x - static_cast<float>(left), down = y - static_cast<float>(top);
  const auto mix = [](float part, float a, float b) { return a + part * (b - a); };
  return static_cast<std::uint8_t>(
      mix(down, mix(right, four[0], four[1]), mix(right, four[2], four[3])) + 0.5F);
}

}  // namespace

PictureWithDepths moved_along_flow(const store::Luma& now, PictureWithDepths then,
                                   store::OpticalFlowEstimator& flow) {
  const store::FlowField field = flow.estimate(now, then.luma);
  PictureWithDepths moved = then;
  raystage::parallel_for(0, now.height, [&](int y) {
    for (int x = 0; x < now.width; ++x) {
      const store::FlowVector& by = field.at(x, y);
      if (std::hypot(by.x, by.y) < kLeastFlow) continue;
      const float u = static_cast<float>(x) + by.x, v = static_cast<float>(y) + by.y;
      const auto column = static_cast<int>(std::lround(u)), row = static_cast<int>(std::lround(v));
      const bool is_inside = then.depths.contains(column, row);
      moved.luma.at(x, y) = is_inside ? luma_at(then.luma, u, v) : std::uint8_t{0};
      moved.depths.at(x, y) = is_inside ? then.depths.at(column, row) : kUnknownDepth;
    }
  });
  return moved;
}

}  // namespace raystage::render
