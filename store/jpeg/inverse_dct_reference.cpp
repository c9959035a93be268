// SPDX-License-Identifier: Apache-2.0
// Scalar reference of inverse_dct(): the integer inverse DCT of Loeffler, Ligtenberg and Moschytz
// (ICASSP 1989) as in libjpeg's jidctint.c, of two 8x8 blocks, columns first, then rows. The SIMD
// kernel must match it bit for bit. Cost: 32 one-dimensional transforms per pair of blocks.
#include <algorithm>
#include <cstdint>

#include "store/jpeg/inverse_dct.h"

namespace raystage::store {
namespace {

// The transform of Loeffler, Ligtenberg and Moschytz as in libjpeg's jidctint.c: cosines times
// 2^13.
constexpr int kConstBits = 13, kPass1Bits = 2;
constexpr std::int32_t k0298 = 2446, k0390 = 3196, k0541 = 4433, k0765 = 6270, k0899 = 7373,
                       k1175 = 9633, k1501 = 12299, k1847 = 15137, k1961 = 16069, k2053 = 16819,
                       k2562 = 20995, k3072 = 25172;

// Returns a + b with wrapping 16 bits, as the SIMD kernel adds; the kernel packs with saturation.
// This differs from exact sums only for coefficients that no encoder writes.
std::int32_t add16(std::int32_t a, std::int32_t b) { return static_cast<std::int16_t>(a + b); }

std::int16_t descale(std::int32_t value, int bits) {
  const std::int64_t rounded = (std::int64_t{value} + (1 << (bits - 1))) >> bits;
  return static_cast<std::int16_t>(std::clamp<std::int64_t>(rounded, -32768, 32767));
}

void transform(std::int16_t* in, std::size_t step, int bits) {
  const auto at = [&](std::size_t i) -> std::int32_t { return in[i * step]; };
  const std::int32_t even3 = at(2) * (k0541 + k0765) + at(6) * k0541;
  const std::int32_t even2 = at(2) * k0541 + at(6) * (k0541 - k1847);
  const std::int32_t even0 = add16(at(0), at(4)) * (1 << kConstBits);
  const std::int32_t even1 = add16(at(0), -at(4)) * (1 << kConstBits);
  const std::int32_t sum3 = add16(at(3), at(7)), sum4 = add16(at(1), at(5));
  const std::int32_t z3 = sum3 * (k1175 - k1961) + sum4 * k1175;
  const std::int32_t z4 = sum3 * k1175 + sum4 * (k1175 - k0390);
  const std::int32_t odd0 = at(7) * (k0298 - k0899) - at(1) * k0899 + z3;
  const std::int32_t odd3 = at(1) * (k1501 - k0899) - at(7) * k0899 + z4;
  const std::int32_t odd1 = at(5) * (k2053 - k2562) - at(3) * k2562 + z4;
  const std::int32_t odd2 = at(3) * (k3072 - k2562) - at(5) * k2562 + z3;
  const std::int32_t evens[4] = {even0 + even3, even1 + even2, even1 - even2, even0 - even3};
  const std::int32_t odds[4] = {odd3, odd2, odd1, odd0};
  for (std::size_t i = 0; i < 4; ++i) {
    in[i * step] = descale(evens[i] + odds[i], bits);
    in[(7 - i) * step] = descale(evens[i] - odds[i], bits);
  }
}

}  // namespace

void inverse_dct_reference(BlockPair& pair) {
  for (std::size_t b = 0; b < 2; ++b) {
    std::int16_t* const block = pair.coefficients.data() + 8 * b;
    for (std::size_t column = 0; column < 8; ++column)
      transform(block + column, 16, kConstBits - kPass1Bits);
    for (std::size_t row = 0; row < 8; ++row)
      transform(block + 16 * row, 1, kConstBits + kPass1Bits + 3);
    if (pair.target[b] == nullptr) continue;
    for (std::size_t i = 0; i < 64; ++i) {
      const int sample = std::clamp(block[i / 8 * 16 + i % 8] + 128, 0, 255);
      pair.target[b][static_cast<std::ptrdiff_t>(i / 8) * pair.stride[b] +
                     static_cast<std::ptrdiff_t>(i % 8)] = static_cast<std::uint8_t>(sample);
    }
  }
  pair.coefficients.fill(0);
}

}  // namespace raystage::store
