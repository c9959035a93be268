// SPDX-License-Identifier: Apache-2.0
// Samples a MatchingFrame bilinearly, in vectors. Output: codes with kCodeBits fractional bits.
// Cost: O(pixels x 3 channels). Included once per instruction set by Highway, so its include guard
// toggles. Must match the samples of matching_cost_reference() (cost_kernels_reference.cpp).

#if defined(RAYSTAGE_RENDER_SWEEP_BLOCK_SAMPLES_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef RAYSTAGE_RENDER_SWEEP_BLOCK_SAMPLES_INL_H
#undef RAYSTAGE_RENDER_SWEEP_BLOCK_SAMPLES_INL_H
#else
#define RAYSTAGE_RENDER_SWEEP_BLOCK_SAMPLES_INL_H
#endif

#include <hwy/highway.h>

#include "render/sweep/block_positions-inl.h"
#include "render/sweep/matching_frame.h"

HWY_BEFORE_NAMESPACE();
namespace raystage::render {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

// Samples are codes with four fractional bits: with weights of 8 and 12 bits they fill 16 bits.
constexpr int kCodeBits = 4;
static_assert(8 + kColumnBits == 16 && 8 + kColumnBits + kRowBits - 16 == 8 + kCodeBits);

using FloatTag = hn::ScalableTag<float>;
using IntTag = hn::RebindToSigned<FloatTag>;
using WordTag = hn::RebindToUnsigned<FloatTag>;
using CodeTag = hn::Repartition<std::uint16_t, WordTag>;
using Floats = hn::Vec<FloatTag>;
using Ints = hn::Vec<IntTag>;
using Words = hn::Vec<WordTag>;
using Codes = hn::Vec<CodeTag>;

/// Columns, and the weights of the two neighbours in both halves of a word.
struct ColumnTaps {
  Ints column;
  Codes word, right;  ///< see weigh()
};
/// Returns the taps at positions in units of 1 / 2^kColumnBits pixel.
HWY_INLINE ColumnTaps column_taps(Ints x) {
  static_assert(kColumnBits == 8, "the fraction is one byte");
  const hn::Repartition<std::uint8_t, IntTag> d8;
  const CodeTag dc;
  const auto lowest_bytes = hn::And(hn::Iota(d8, 0), hn::Set(d8, 0x0C));
  const auto part = hn::BitCast(dc, hn::TableLookupBytes(hn::BitCast(d8, x), lowest_bytes));
  const auto one = hn::Set(dc, std::uint16_t{1} << kColumnBits);
  return {hn::ShiftRight<kColumnBits>(x), hn::Sub(one, hn::And(part, hn::Set(dc, 0xFF))), part};
}

/// Returns the weights of two rows, the upper one's in the lower half. `part`: 0 to 2^kRowBits.
HWY_INLINE Codes row_weights(Ints part) {
  const IntTag d;
  const CodeTag dc;
  const auto rest = hn::Sub(hn::Set(d, 1 << kRowBits), part);
  return hn::BitCast(dc, hn::Add(hn::ShiftLeft<16>(part), rest));
}

struct Words3 {
  Words red, green, blue;
};
/// The words of a row, and the distance to the same row of the next channel.
struct Row {
  const std::uint32_t* words = nullptr;
  std::ptrdiff_t pitch = 0;
  Row below(std::ptrdiff_t rows) const { return {words + 3 * pitch * rows, pitch}; }
};

/// Looks lanes up in one or two tables of as many words as a vector has.
template <bool kTwoTables>
HWY_INLINE Words pick(const std::uint32_t* table, Words index) {
  const WordTag d;
  const auto lanes = static_cast<std::uint32_t>(hn::Lanes(d));
  if (!kTwoTables) return hn::TableLookupLanes(hn::LoadU(d, table), hn::IndicesFromVec(d, index));
  const auto within = hn::IndicesFromVec(d, hn::And(index, hn::Set(d, lanes - 1)));
  return hn::IfThenElse(hn::Lt(index, hn::Set(d, lanes)),
                        hn::TableLookupLanes(hn::LoadU(d, table), within),
                        hn::TableLookupLanes(hn::LoadU(d, table + lanes), within));
}
template <bool kTwoTables>
HWY_INLINE Words3 pick_channels(const Row& row, std::ptrdiff_t column, Words index) {
  const std::uint32_t* words = row.words + column;
  return {pick<kTwoTables>(words, index), pick<kTwoTables>(words + row.pitch, index),
          pick<kTwoTables>(words + 2 * row.pitch, index)};
}

/// Reads lane by lane, at any positions.
HWY_INLINE Words3 gather_scalar(const Row& origin, Ints columns, Ints rows) {
  const WordTag d;
  const IntTag di;
  constexpr std::size_t kMaxLanes = 16;
  HWY_ALIGN std::int32_t column[kMaxLanes], row[kMaxLanes];
  HWY_ALIGN std::uint32_t red[kMaxLanes], green[kMaxLanes], blue[kMaxLanes];
  hn::Store(columns, di, column);
  hn::Store(rows, di, row);
  for (std::size_t i = 0; i < hn::Lanes(d); ++i) {
    const std::uint32_t* word = origin.below(row[i]).words + column[i];
    red[i] = word[0];
    green[i] = word[origin.pitch];
    blue[i] = word[2 * origin.pitch];
  }
  return {hn::Load(d, red), hn::Load(d, green), hn::Load(d, blue)};
}

/// Reads from one row, from column `first` on. Adjacent lanes usually read adjacent columns: then
/// one or two vectors hold them all.
HWY_INLINE Words3 gather_row(const Row& row, std::int32_t first, Ints columns) {
  const IntTag di;
  const WordTag d;
  const auto lanes = static_cast<std::uint32_t>(hn::Lanes(d));
  const auto index = hn::BitCast(d, hn::Sub(columns, hn::Set(di, first)));
  if (HWY_LIKELY(hn::AllTrue(d, hn::Lt(index, hn::Set(d, lanes))))) {
    return pick_channels<false>(row, first, index);
  }
  if (hn::AllTrue(d, hn::Lt(index, hn::Set(d, 2 * lanes)))) {
    return pick_channels<true>(row, first, index);
  }
  return gather_scalar(row, columns, hn::Zero(di));
}

/// The columns and rows that a vector's pixels read, relative to the origin.
struct SourceBounds {
  std::int32_t column = 0, row = 0;  ///< the first
  int more_rows = 0;                 ///< 2 for any larger number
};

/// Reads from several rows; `rows` are relative to the first needed.
HWY_INLINE Words3 gather_rows(const Row& origin, const SourceBounds& need, Ints columns,
                              Ints rows) {
  const WordTag d;
  const Row first = origin.below(need.row);
  if (need.more_rows > 1) return gather_scalar(first, columns, rows);
  const Words3 upper = gather_row(first, need.column, columns);
  const Words3 lower = gather_row(first.below(1), need.column, columns);
  const auto is_upper = hn::RebindMask(d, hn::Eq(rows, hn::Zero(IntTag())));
  return {hn::IfThenElse(is_upper, upper.red, lower.red),
          hn::IfThenElse(is_upper, upper.green, lower.green),
          hn::IfThenElse(is_upper, upper.blue, lower.blue)};
}

/// Returns a word's weighted sum in two parts, one per half. A half is left + 256 right. Its result
/// (256 - part) left + part right is (256 - part) half + 257 part right in 16 bits.
HWY_INLINE Codes weigh(Words words, const ColumnTaps& columns, Codes rows) {
  const CodeTag d;
  const auto both = hn::BitCast(d, words);
  const auto right = hn::ShiftRight<8>(both);
  const auto row = hn::Add(hn::Mul(both, columns.word), hn::Mul(right, columns.right));
  return hn::MulHigh(row, rows);
}
/// Adds both parts of two vectors: even lanes are the first's, odd lanes the second's.
HWY_INLINE Codes join(Codes first, Codes second) {
  const CodeTag dc;
  return hn::Add(hn::OddEven(second, first), hn::Reverse2(dc, hn::OddEven(first, second)));
}

// NOLINTNEXTLINE(google-readability-namespace-comments)
}  // namespace HWY_NAMESPACE
}  // namespace raystage::render
HWY_AFTER_NAMESPACE();

#endif  // per target
