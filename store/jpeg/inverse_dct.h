// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace raystage {

/// Two 8x8 blocks of dequantised coefficients, row by row, the rows of both beside each other:
/// coefficient (row, column) of block b is at row * 16 + b * 8 + column.
struct BlockPair {
  alignas(64) std::array<std::int16_t, 128> coefficients{};
  std::array<std::uint8_t*, 2> target{};   ///< top left sample; nullptr: nothing is written
  std::array<std::ptrdiff_t, 2> stride{};  ///< bytes from row to row
};

/// Index in a BlockPair of the first block's coefficients by zigzag position; 16 more of the last.
extern const std::array<std::uint8_t, 80> kPairIndex;

/// The accurate integer inverse DCT, bit for bit libjpeg-turbo's JDCT_ISLOW with SIMD, samples
/// shifted by 128 and limited to 0-255. Clears the coefficients for the next two blocks.
void inverse_dct(BlockPair& pair);

/// Name of the instruction set that it runs under.
const char* inverse_dct_target();

/// The same, one number at a time.
void inverse_dct_reference(BlockPair& pair);

/// What inverse_dct makes of a block without AC coefficients.
std::uint8_t dc_only_sample(std::int16_t dc);

}  // namespace raystage
