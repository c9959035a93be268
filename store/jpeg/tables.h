// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "store/jpeg/layout.h"

namespace raystage {

/// What the next bits of a scan mean: a Huffman code and the number of value bits that follow it.
struct HuffmanEntry {
  std::uint8_t code_length = 0;   ///< bits; 0: a longer code, or none
  std::uint8_t total_length = 0;  ///< code and value, bits
  std::uint8_t value_bits = 0;    ///< 0 for end of block and for a run of 16 zeros
  std::uint8_t advance = 0;  ///< positions in zigzag order: zeros and the coefficient; 64 at EOB
};

/// One Huffman table made for speed. ITU-T T.81 annex C, F.2.2.3.
class HuffmanTable {
 public:
  static constexpr int kLookupBits = 10;
  static constexpr int kMaxBits = 16;

  /// `counts`: codes of each length 1-16. False where no such code exists, or (`dc`) where a symbol
  /// lies outside 0-15.
  bool build(std::span<const std::uint8_t, kMaxBits> counts, std::span<const std::uint8_t> symbols,
             bool dc);

  /// By the next kLookupBits bits.
  const HuffmanEntry& look_up(std::uint32_t bits) const { return lookup_[bits]; }
  /// By the next 16 bits; code_length 0 where they begin with no code.
  HuffmanEntry find(std::uint32_t bits) const;
  bool defined() const { return defined_; }

 private:
  static HuffmanEntry entry_of(int symbol, int length);

  std::array<HuffmanEntry, 1 << kLookupBits> lookup_;
  std::array<std::uint32_t, kMaxBits + 1> limit_{};  ///< first 16 bits beyond the codes of a length
  std::array<std::int32_t, kMaxBits + 1> offset_{};  ///< of a length's codes in symbols_
  std::array<std::uint8_t, 256> symbols_{};
  bool defined_ = false;
};

/// The tables of a baseline scan, by component.
struct ScanTables {
  std::array<HuffmanTable, 4> dc, ac;
  std::array<int, 3> dc_table{}, ac_table{};  ///< of each component
  /// Per component in zigzag order, then 16 times the last: a damaged run may end beyond it.
  std::array<std::array<std::uint16_t, 80>, 3> quantisation{};
};

/// Reads the header's tables. Huffman tables 0 and 1 that are not there are the standard ones (T.81
/// K.3), as in the frames of many cameras. Throws Error (bad input).
void read_scan_tables(std::span<const std::byte> jpeg, const JpegLayout& layout,
                      std::string_view name, ScanTables& tables);

}  // namespace raystage
