// SPDX-License-Identifier: Apache-2.0
// Integer inverse DCT of two 8x8 blocks at a time: the accurate algorithm of libjpeg-turbo
// (JDCT_ISLOW: Loeffler, Ligtenberg and Moschytz, ICASSP 1989), bit for bit. Must match
// inverse_dct_reference() exactly.
#include "store/jpeg/inverse_dct.h"

#include <algorithm>
#include <cstring>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "store/jpeg/inverse_dct.cpp"
// foreach_target.h must come first.
// clang-format off
#include <hwy/foreach_target.h>
#include <hwy/highway.h>
// clang-format on

HWY_BEFORE_NAMESPACE();
namespace raystage::store {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

#if HWY_TARGET == HWY_SCALAR

void InverseDct(BlockPair& pair) { inverse_dct_reference(pair); }

#else

// One vector holds a row of eight coefficients of each of one or two blocks.
constexpr hn::CappedTag<std::int16_t, 16> kShort;
constexpr hn::Repartition<std::int32_t, decltype(kShort)> kInt;
using Short = hn::Vec<decltype(kShort)>;
using Int = hn::Vec<decltype(kInt)>;

// A row widened: the halves that InterleaveLower and InterleaveUpper make.
struct Wide {
  Int lower, upper;
};

HWY_INLINE Wide operator+(Wide a, Wide b) {
  return {hn::Add(a.lower, b.lower), hn::Add(a.upper, b.upper)};
}
HWY_INLINE Wide operator-(Wide a, Wide b) {
  return {hn::Sub(a.lower, b.lower), hn::Sub(a.upper, b.upper)};
}

// Constants of jidctint.c: cosines times 2^13.
constexpr int kConstBits = 13, kPass1Bits = 2;
constexpr int k0298 = 2446, k0390 = 3196, k0541 = 4433, k0765 = 6270, k0899 = 7373, k1175 = 9633,
              k1501 = 12299, k1847 = 15137, k1961 = 16069, k2053 = 16819, k2562 = 20995,
              k3072 = 25172;

// Two rows, interleaved lane by lane.
struct Interleaved {
  Short lower, upper;
};
HWY_INLINE Interleaved interleave(Short a, Short b) {
  return {hn::InterleaveLower(kShort, a, b), hn::InterleaveUpper(kShort, a, b)};
}

HWY_INLINE Int multiply_pairs(Short pairs, Short factors) {
  Int odd = hn::Zero(kInt);
  const Int sum = hn::ReorderWidenMulAccumulate(kInt, pairs, factors, hn::Zero(kInt), odd);
  return hn::RearrangeToOddPlusEven(sum, odd);
}

// Returns a * factor_a + b * factor_b.
template <int kFactorA, int kFactorB>
HWY_INLINE Wide combine(Interleaved ab) {
  static_assert(kFactorA >= -32768 && kFactorA < 32768 && kFactorB >= -32768 && kFactorB < 32768);
  const auto bits = (static_cast<std::uint32_t>(kFactorB) & 0xFFFF) << 16 |
                    (static_cast<std::uint32_t>(kFactorA) & 0xFFFF);
  const Short factors = hn::BitCast(kShort, hn::Set(kInt, static_cast<std::int32_t>(bits)));
  return {multiply_pairs(ab.lower, factors), multiply_pairs(ab.upper, factors)};
}

// Returns a << kConstBits: moves a to the upper half of each int, then shifts it back with its
// sign.
HWY_INLINE Wide scale_up(Short a) {
  const Interleaved high = interleave(hn::Zero(kShort), a);
  return {hn::ShiftRight<16 - kConstBits>(hn::BitCast(kInt, high.lower)),
          hn::ShiftRight<16 - kConstBits>(hn::BitCast(kInt, high.upper))};
}

template <int kBits>
HWY_INLINE Short descale(Wide a) {
  return hn::ReorderDemote2To(kShort, hn::ShiftRight<kBits>(a.lower),
                              hn::ShiftRight<kBits>(a.upper));
}

// Computes the one-dimensional transform of the columns. `kBits`: scale removed from the result.
template <int kBits>
HWY_INLINE void transform(Short (&row)[8]) {
  const Wide rounding{hn::Set(kInt, 1 << (kBits - 1)), hn::Set(kInt, 1 << (kBits - 1))};
  const Interleaved even = interleave(row[2], row[6]);
  const Wide even2 = combine<k0541, k0541 - k1847>(even);
  const Wide even3 = combine<k0541 + k0765, k0541>(even);
  const Wide even0 = scale_up(hn::Add(row[0], row[4])) + rounding;
  const Wide even1 = scale_up(hn::Sub(row[0], row[4])) + rounding;
  const Wide sum0 = even0 + even3, sum3 = even0 - even3;
  const Wide sum1 = even1 + even2, sum2 = even1 - even2;

  const Interleaved z34 = interleave(hn::Add(row[3], row[7]), hn::Add(row[1], row[5]));
  const Wide z3 = combine<k1175 - k1961, k1175>(z34);
  const Wide z4 = combine<k1175, k1175 - k0390>(z34);
  const Interleaved odd71 = interleave(row[7], row[1]), odd53 = interleave(row[5], row[3]);
  const Wide odd0 = combine<k0298 - k0899, -k0899>(odd71) + z3;
  const Wide odd3 = combine<-k0899, k1501 - k0899>(odd71) + z4;
  const Wide odd1 = combine<k2053 - k2562, -k2562>(odd53) + z4;
  const Wide odd2 = combine<-k2562, k3072 - k2562>(odd53) + z3;

  row[0] = descale<kBits>(sum0 + odd3);
  row[7] = descale<kBits>(sum0 - odd3);
  row[1] = descale<kBits>(sum1 + odd2);
  row[6] = descale<kBits>(sum1 - odd2);
  row[2] = descale<kBits>(sum2 + odd1);
  row[5] = descale<kBits>(sum2 - odd1);
  row[3] = descale<kBits>(sum3 + odd0);
  row[4] = descale<kBits>(sum3 - odd0);
}

// Transposes each block of eight lanes.
HWY_INLINE void transpose(Short (&row)[8]) {
  Interleaved words[4], pairs[4];
  for (int i = 0; i < 4; ++i) words[i] = interleave(row[i], row[i + 4]);  // columns of 2 rows
  // words[i]: rows i and i + 4; lower columns 0-3, upper columns 4-7.
  pairs[0] = interleave(words[0].lower, words[2].lower);  // columns 0-1, 2-3 of rows 0 2 4 6
  pairs[1] = interleave(words[1].lower, words[3].lower);  // ... of rows 1 3 5 7
  pairs[2] = interleave(words[0].upper, words[2].upper);  // columns 4-5, 6-7
  pairs[3] = interleave(words[1].upper, words[3].upper);
  for (int half = 0; half < 2; ++half) {
    const Interleaved first = interleave(pairs[2 * half].lower, pairs[2 * half + 1].lower);
    const Interleaved second = interleave(pairs[2 * half].upper, pairs[2 * half + 1].upper);
    row[4 * half] = first.lower;
    row[4 * half + 1] = first.upper;
    row[4 * half + 2] = second.lower;
    row[4 * half + 3] = second.upper;
  }
}

void InverseDct(BlockPair& pair) {
  constexpr std::size_t kLanes = hn::MaxLanes(kShort);
  constexpr hn::Rebind<std::uint8_t, decltype(kShort)> kSamples;
  std::int16_t* const coefficients = pair.coefficients.data();
  alignas(64) std::uint8_t samples[8][16];
  for (std::size_t lane = 0; lane < 16; lane += kLanes) {
    Short row[8];
    for (std::size_t r = 0; r < 8; ++r) {
      row[r] = hn::Load(kShort, coefficients + r * 16 + lane);
      hn::Store(hn::Zero(kShort), kShort, coefficients + r * 16 + lane);
    }
    transform<kConstBits - kPass1Bits>(row);
    transpose(row);
    transform<kConstBits + kPass1Bits + 3>(row);
    transpose(row);
    for (std::size_t r = 0; r < 8; ++r) {
      const Short shifted = hn::SaturatedAdd(row[r], hn::Set(kShort, 128));
      hn::Store(hn::DemoteTo(kSamples, shifted), kSamples, samples[r] + lane);
    }
  }
  for (std::size_t b = 0; b < 2; ++b) {
    std::uint8_t* target = pair.target[b];
    if (target == nullptr) continue;
    for (std::size_t r = 0; r < 8; ++r, target += pair.stride[b])
      std::memcpy(target, samples[r] + 8 * b, 8);
  }
}

#endif  // HWY_TARGET == HWY_SCALAR

const char* target() { return hwy::TargetName(HWY_TARGET); }

}  // namespace HWY_NAMESPACE
}  // namespace raystage::store
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace raystage::store {

HWY_EXPORT(InverseDct);
HWY_EXPORT(target);

void inverse_dct(BlockPair& pair) { HWY_DYNAMIC_DISPATCH(InverseDct)(pair); }

const char* inverse_dct_target() { return HWY_DYNAMIC_DISPATCH(target)(); }

std::uint8_t dc_only_sample(std::int16_t dc) {
  const auto scaled =
      static_cast<std::int16_t>(static_cast<unsigned>(dc) << 2);  // 16 bits, as SIMD
  return static_cast<std::uint8_t>(std::clamp(((scaled + 16) >> 5) + 128, 0, 255));
}

constexpr std::array<std::uint8_t, 80> kZigzagToPairIndex = [] {
  std::array<std::uint8_t, 80> index{};
  int row = 0, column = 0;
  for (std::size_t k = 0; k < 64; ++k) {
    index[k] = static_cast<std::uint8_t>(row * 16 + column);
    const bool upwards = (row + column) % 2 == 0;
    if (upwards) {
      if (column == 7) {
        ++row;
      } else {
        ++column;
        if (row > 0) --row;
      }
    } else {
      if (row == 7) {
        ++column;
      } else {
        ++row;
        if (column > 0) --column;
      }
    }
  }
  std::fill(index.begin() + 64, index.end(), index[63]);
  return index;
}();

}  // namespace raystage::store
#endif
