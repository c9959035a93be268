// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace raystage::store {

/// Two 8x8 blocks of dequantised coefficients, row by row, side by side. Coefficient (row, column)
/// of block b is at row * 16 + b * 8 + column.
struct BlockPair {
  alignas(64) std::array<std::int16_t, 128> coefficients{};
  std::array<std::uint8_t*, 2> target{};   ///< top left sample; nullptr: nothing is written
  std::array<std::ptrdiff_t, 2> stride{};  ///< bytes from row to row
};

/// Index in a BlockPair of the first block's coefficients by zigzag position, then 16 times the
/// last.
extern const std::array<std::uint8_t, 80> kZigzagToPairIndex;

/// Computes the accurate integer inverse DCT of both blocks, bit for bit as libjpeg-turbo's
/// JDCT_ISLOW with SIMD. Writes samples shifted by 128 and clamped to 0-255. Clears the
/// coefficients for the next two blocks.
void inverse_dct(BlockPair& pair);

/// Returns the name of the instruction set that inverse_dct uses.
const char* inverse_dct_target();

/// Computes the same one number at a time: the reference of inverse_dct.
void inverse_dct_reference(BlockPair& pair);

/// Returns the sample that inverse_dct writes for a block without AC coefficients.
std::uint8_t dc_only_sample(std::int16_t dc);

}  // namespace raystage::store
