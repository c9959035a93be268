// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "store/jpeg/layout.h"

namespace raystage::store {

/// The meaning of the next bits of a scan: a Huffman code and the number of value bits after it.
struct HuffmanEntry {
  std::uint8_t code_length = 0;   ///< bits; 0: a longer code, or none
  std::uint8_t total_length = 0;  ///< code and value, bits
  std::uint8_t value_bits = 0;    ///< 0 for end of block and for a run of 16 zeros
  std::uint8_t advance = 0;  ///< positions in zigzag order: zeros and the coefficient; 64 at EOB
};

/// A Huffman table for fast lookup. ITU-T T.81 annex C, F.2.2.3.
class HuffmanTable {
 public:
  static constexpr int kLookupBits = 10;
  static constexpr int kMaxBits = 16;

  /// Builds the table; `counts`: codes of each length 1-16. Returns false if no such code exists,
  /// or (`dc`) a symbol is outside of 0-15.
  bool build(std::span<const std::uint8_t, kMaxBits> counts, std::span<const std::uint8_t> symbols,
             bool dc);

  /// Returns the entry for the next kLookupBits bits.
  const HuffmanEntry& look_up(std::uint32_t bits) const { return lookup_[bits]; }
  /// Returns the entry for the next 16 bits; code_length is 0 if they begin with no code.
  HuffmanEntry find(std::uint32_t bits) const;
  bool defined() const { return defined_; }

 private:
  static HuffmanEntry make_entry(int symbol, int length);

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
  /// Per component in zigzag order, then 16 times the last, as a damaged run may end beyond it.
  std::array<std::array<std::uint16_t, 80>, 3> quantisation{};
};

/// Reads the tables of the header. Missing Huffman tables 0 and 1 are the standard ones (T.81 K.3),
/// as in the frames of many cameras. Throws Error (bad input) if a table is damaged or missing.
void read_scan_tables(std::span<const std::byte> jpeg, const JpegLayout& layout,
                      std::string_view name, ScanTables& tables);

}  // namespace raystage::store
