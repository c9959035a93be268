// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>

#include "store/processing/motion/optical_flow.h"

namespace raystage::store {

/// Returns (1 - part) a + part b, code by code. `part` in [0, 1], from a to b. Equal sizes.
RgbImage blend(const RgbImage& a, const RgbImage& b, double part);

/// Returns the frame at time fraction `part` in [0, 1] between a and b, from the optical flow in
/// both directions. Flow vectors are projected to that time. Where several land on one pixel, the
/// one with the smallest difference of a and b over a small window is kept. Holes take their
/// neighbours' vectors (Baker et al., "A database and evaluation methodology for optical flow",
/// IJCV 2011, section 3.3.2). A median filter removes outliers. Each pixel then samples a and b
/// along its vector. A frame whose own flow differs there is occluded and gets almost no weight.
RgbImage interpolate_frame(const FlowImage& a, const FlowImage& b, const FlowField& b_from_a,
                           const FlowField& a_from_b, double part);

/// Two frames of a camera in which things move.
struct MovingPair {
  const Luma &a, &b;
  const FlowField &b_from_a, &a_from_b;
};

/// Writes the interpolated frame of 16-bit frames, R, G, B, A per pixel, premultiplied, rows
/// without padding, to `out`, which is as large as `a` and `b`.
void interpolate_levels(const MovingPair& pair, double part, std::span<const std::uint16_t> a,
                        std::span<const std::uint16_t> b, std::span<std::uint16_t> out);

}  // namespace raystage::store
