// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>

#include "store/processing/motion/frame_interpolation.h"

namespace raystage::store {

/// Writes the interpolated frame of 8-bit codes, R, G, B per pixel, see interpolate_frame().
void interpolate_codes(const MovingPair& pair, const InstantBetween& instant,
                       std::span<const std::uint8_t> a, std::span<const std::uint8_t> b,
                       std::span<std::uint8_t> out);
/// Writes that of 16-bit levels, see interpolate_levels().
void interpolate_rgba_levels(const MovingPair& pair, const InstantBetween& instant,
                             std::span<const std::uint16_t> a, std::span<const std::uint16_t> b,
                             std::span<std::uint16_t> out);

}  // namespace raystage::store
