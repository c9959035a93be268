// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>

#include "rig/row_times.h"
#include "store/processing/motion/optical_flow.h"

namespace raystage::store {

/// Returns (1 - part) a + part b, code by code. `part` in [0, 1], from a to b. Equal sizes.
RgbImage blend(const RgbImage& a, const RgbImage& b, double part);

/// An instant between two frames a and b of a camera, in fractions of the time from a to b.
struct InstantBetween {
  double part = 0;  ///< of the instant, from the middle row of a (0) to that of b (1)
  /// From the exposure of a row to that of the row below: the line time. 0: global shutter.
  double line_part = 0;

  /// Returns the fraction at height `y` of the frames (pixels, centres at +0.5): the time from the
  /// exposure of that row of a. Below 0 and above 1 the instant is outside of the frames' own
  /// times.
  double at(double y, int height) const { return part - rig::row_time(line_part, height, y); }
};

/// Returns the frame at an instant between a and b, from the optical flow in both directions. Flow
/// vectors are projected to that time. Where several land on one pixel, the one with the smallest
/// difference of a and b over a small window is kept. Holes take their neighbours' vectors (Baker
/// et al., "A database and evaluation methodology for optical flow", IJCV 2011, section 3.3.2). A
/// median filter removes outliers. Each pixel then samples a and b along its vector. A frame whose
/// own flow differs there is occluded and gets almost no weight. With a rolling shutter every row
/// moves from its own time to the instant, along straight lines. Rows outside of their frames'
/// times are extrapolated, by at most kMaxExtrapolation. `part`: from 0 to 1.
RgbImage interpolate_frame(const FlowImage& a, const FlowImage& b, const FlowField& b_from_a,
                           const FlowField& a_from_b, const InstantBetween& instant);

/// Largest extrapolation of a row, in fractions of the time between the frames: half of it is what
/// a read-out needs that takes all of the time.
inline constexpr double kMaxExtrapolation = 0.5;

/// Two frames of a camera in which things move.
struct MovingPair {
  const Luma &a, &b;
  const FlowField &b_from_a, &a_from_b;
};

/// Writes the interpolated frame of 16-bit frames, R, G, B, A per pixel, premultiplied, rows
/// without padding, to `out`, which is as large as `a` and `b`.
void interpolate_levels(const MovingPair& pair, const InstantBetween& instant,
                        std::span<const std::uint16_t> a, std::span<const std::uint16_t> b,
                        std::span<std::uint16_t> out);

}  // namespace raystage::store
