// SPDX-License-Identifier: Apache-2.0
// Decodes wanted MCUs of a baseline scan (ITU-T T.81 F.2). Huffman decoding with a 10-bit table
// lookup, dequantisation, and inverse DCT of two blocks at a time. Input: file bytes, layout and
// MCU mask; output: one 8-bit plane per component. Cost: O(bytes of the segments up to their last
// wanted MCU).
#include "store/jpeg/scan_decoder.h"

#include <algorithm>
#include <bit>
#include <cassert>
#include <cstring>
#include <string>

#include "base/error.h"
#include "store/jpeg/libjpeg.h"

namespace raystage::store {
namespace {

// Ten blocks of 64 coefficients of at most 31 bits, and the reader's own look-ahead.
constexpr std::size_t kReadAhead = 2560;

// The bits of a segment without stuffed zeros, the first bit at the top of `bits_`. Reads beyond
// the end return any bits of the buffer; consumed() detects them.
class BitReader {
 public:
  explicit BitReader(const std::uint8_t* begin) : begin_(begin), next_(begin) {}

  // Makes at least 56 bits available.
  void refill() {
    std::uint64_t word;
    std::memcpy(&word, next_, sizeof(word));
    static_assert(std::endian::native == std::endian::little);
    word = __builtin_bswap64(word);
    bits_ |= word >> count_;
    next_ += (63 - count_) >> 3;
    count_ |= 56;
  }
  void need_symbol() {
    if (count_ < 32) refill();
  }
  std::uint32_t peek(int count) const { return static_cast<std::uint32_t>(bits_ >> (64 - count)); }
  void drop(unsigned count) {
    bits_ <<= count;
    count_ -= count;
  }
  std::uint64_t bits() const { return bits_; }
  const std::uint8_t* position() const { return next_; }
  std::size_t consumed() const { return static_cast<std::size_t>(next_ - begin_) * 8 - count_; }

 private:
  std::uint64_t bits_ = 0;
  unsigned count_ = 0;
  const std::uint8_t* begin_;
  const std::uint8_t* next_;
};

// Returns the value of `entry`, whose code is first in the bits. T.81 F.2.2.1 EXTEND.
inline std::int32_t value_of(HuffmanEntry entry, std::uint64_t bits) {
  bits <<= entry.code_length;
  const auto raw = static_cast<std::int32_t>(bits >> 1 >> (63 - entry.value_bits));
  const auto negative = static_cast<std::int32_t>(~static_cast<std::int64_t>(bits) >> 63);
  return raw - (negative & ((1 << entry.value_bits) - 1));
}

// Reads the next symbol and its value's length; returns false for an invalid code.
inline bool next_symbol(BitReader& reader, const HuffmanTable& table, HuffmanEntry& entry) {
  reader.need_symbol();
  entry = table.look_up(reader.peek(HuffmanTable::kLookupBits));
  if (entry.code_length == 0) [[unlikely]] {
    entry = table.find(reader.peek(HuffmanTable::kMaxBits));
    return entry.code_length != 0;
  }
  return true;
}

// Adds as the DC predictor of libjpeg, but wraps on overflow.
inline std::int32_t add(std::int32_t a, std::int32_t b) {
  return static_cast<std::int32_t>(static_cast<std::uint32_t>(a) + static_cast<std::uint32_t>(b));
}
inline std::int16_t dequantise(std::int32_t value, std::uint16_t step) {
  return static_cast<std::int16_t>(static_cast<std::uint32_t>(value) * step);
}

struct BlockTables {
  const HuffmanTable* dc;
  const HuffmanTable* ac;
  const std::uint16_t* steps;
};

enum class BlockResult { kDamaged, kDcOnly, kFull };

// Decodes one block; without `kStore` it skips the block, except its DC difference.
template <bool kStore>
BlockResult decode_block(BitReader& shared, const BlockTables& tables, std::int32_t& dc_predictor,
                         std::int16_t* coefficients) {
  BitReader reader = shared;
  HuffmanEntry entry;
  if (!next_symbol(reader, *tables.dc, entry)) return BlockResult::kDamaged;
  dc_predictor = add(dc_predictor, value_of(entry, reader.bits()));
  reader.drop(entry.total_length);
  if (kStore) coefficients[0] = dequantise(dc_predictor, tables.steps[0]);
  BlockResult result = BlockResult::kDcOnly;
  for (unsigned k = 0; k < 63;) {
    if (!next_symbol(reader, *tables.ac, entry)) return BlockResult::kDamaged;
    k += entry.advance;
    if (kStore && entry.value_bits != 0) {
      coefficients[kZigzagToPairIndex[k]] =
          dequantise(value_of(entry, reader.bits()), tables.steps[k]);
      result = BlockResult::kFull;
    }
    reader.drop(entry.total_length);
  }
  shared = reader;
  return result;
}

[[noreturn]] void fail(const std::string& what, std::size_t offset, std::string_view name) {
  throw Error::bad_input("damaged JPEG: " + what,
                         std::string(name) + " @byte " + std::to_string(offset),
                         "Replace the file or remove the frame");
}

}  // namespace

void ScanDecoder::prepare(std::span<const std::byte> jpeg, const JpegLayout& layout,
                          std::string_view name) {
  const auto header = jpeg.first(layout.scan_offset);
  if (!std::ranges::equal(header, header_)) {
    header_.clear();  // stays empty if the tables are damaged
    read_scan_tables(jpeg, layout, name, tables_);
    header_.assign(header.begin(), header.end());
  }
  const int h_max = layout.mcu_width / 8, v_max = layout.mcu_height / 8;
  for (int c = 0; c < layout.components; ++c) {
    Plane& plane = planes_[c];
    plane.width = (layout.width * layout.h[c] + h_max - 1) / h_max;
    plane.height = (layout.height * layout.v[c] + v_max - 1) / v_max;
    plane.stride = static_cast<std::size_t>(layout.mcus_per_row * layout.h[c]) * 8;
    const std::size_t size =
        plane.stride * static_cast<std::size_t>(layout.mcu_rows * layout.v[c]) * 8;
    if (plane.samples.size() < size + Plane::kPadding) plane.samples.resize(size + Plane::kPadding);
  }
}

std::int64_t ScanDecoder::decode(std::span<const std::byte> jpeg, const JpegLayout& layout,
                                 std::span<const std::uint8_t> wanted, std::string_view name) {
  assert(layout.baseline_ycc && wanted.size() == static_cast<std::size_t>(layout.mcu_count()));
  if (!clean_) pair_ = {};  // decoding of a damaged frame was aborted
  clean_ = false;
  pending_ = 0;
  prepare(jpeg, layout, name);
  const int interval = layout.restart_interval > 0 ? layout.restart_interval : layout.mcu_count();
  const auto is_wanted = [](std::uint8_t w) { return w != 0; };
  std::int64_t decoded = 0;
  for (int s = 0; s < layout.segment_count(); ++s) {
    const int first = s * interval, end = std::min(first + interval, layout.mcu_count());
    const auto mine =
        wanted.subspan(static_cast<std::size_t>(first), static_cast<std::size_t>(end - first));
    const auto last = std::find_if(mine.rbegin(), mine.rend(), is_wanted);
    if (last == mine.rend()) continue;
    const auto index = static_cast<std::size_t>(s);
    Segment segment;
    segment.first_mcu = first;
    segment.end_mcu = first + static_cast<int>(mine.rend() - last);
    segment.whole = segment.end_mcu == end;
    segment.begin = layout.segment_offset[index];
    segment.end = layout.segment_offset[index + 1] - 2;
    decode_segment(jpeg, layout, segment, wanted, name);
    decoded += segment.end_mcu - segment.first_mcu;
  }
  if (pending_ > 0) {
    inverse_dct(pair_);
    pair_.target = {};
    pending_ = 0;
  }
  clean_ = true;
  return decoded;
}

std::span<const std::uint8_t> ScanDecoder::unstuff(std::span<const std::byte> bytes) {
  if (bits_.size() < bytes.size() + kReadAhead) bits_.resize(bytes.size() + kReadAhead);
  const std::byte* from = bytes.data();
  const std::byte* const end = from + bytes.size();
  std::uint8_t* to = bits_.data();
  while (from < end) {
    const auto left = static_cast<std::size_t>(end - from);
    const void* found = std::memchr(from, 0xFF, left);
    const std::size_t plain =
        found == nullptr ? left
                         : static_cast<std::size_t>(static_cast<const std::byte*>(found) - from);
    std::memcpy(to, from, plain);
    to += plain;
    from += plain;
    if (from == end) break;
    if (end - from > 1 && from[1] == std::byte{0}) *to++ = 0xFF;  // otherwise a fill byte
    from += end - from > 1 && from[1] == std::byte{0} ? 2 : 1;
  }
  return {bits_.data(), static_cast<std::size_t>(to - bits_.data())};
}

void ScanDecoder::decode_segment(std::span<const std::byte> jpeg, const JpegLayout& layout,
                                 const Segment& segment, std::span<const std::uint8_t> wanted,
                                 std::string_view name) {
  const auto bytes = unstuff(jpeg.subspan(segment.begin, segment.end - segment.begin));
  BitReader reader(bytes.data());
  const std::uint8_t* const last = bytes.data() + bytes.size() + 8;
  std::int32_t dc_predictor[3] = {};
  BlockTables tables[3] = {};
  for (std::size_t c = 0; c < static_cast<std::size_t>(layout.components); ++c)
    tables[c] = {&tables_.dc[tables_.dc_table[c]], &tables_.ac[tables_.ac_table[c]],
                 tables_.quantisation[c].data()};
  auto column = static_cast<std::size_t>(segment.first_mcu % layout.mcus_per_row);
  auto row = static_cast<std::size_t>(segment.first_mcu / layout.mcus_per_row);
  for (int mcu = segment.first_mcu; mcu < segment.end_mcu; ++mcu) {
    const bool store = wanted[mcu] != 0;
    bool good = reader.position() <= last;
    for (int c = 0; c < layout.components && good; ++c) {
      const auto h = static_cast<std::size_t>(layout.h[c]),
                 v = static_cast<std::size_t>(layout.v[c]);
      for (std::size_t block = 0; block < h * v && good; ++block) {
        if (!store) {
          good = decode_block<false>(reader, tables[c], dc_predictor[c], nullptr) !=
                 BlockResult::kDamaged;
          continue;
        }
        Plane& plane = planes_[c];
        std::uint8_t* const target =
            plane.at((column * h + block % h) * 8, (row * v + block / h) * 8);
        std::int16_t* const coefficients = pair_.coefficients.data() + 8 * pending_;
        const BlockResult result =
            decode_block<true>(reader, tables[c], dc_predictor[c], coefficients);
        if (result == BlockResult::kFull) {
          pair_.target[pending_] = target;
          pair_.stride[pending_] = static_cast<std::ptrdiff_t>(plane.stride);
          if (++pending_ == 2) {
            inverse_dct(pair_);
            pending_ = 0;
            pair_.target = {};
          }
        } else {
          const std::uint8_t sample = dc_only_sample(coefficients[0]);
          coefficients[0] = 0;
          for (std::size_t r = 0; r < 8; ++r) std::memset(target + r * plane.stride, sample, 8);
          good = result != BlockResult::kDamaged;
        }
      }
    }
    if (!good) {
      fail("invalid Huffman code in restart segment " +
               std::to_string(mcu / std::max(1, layout.restart_interval)),
           segment.begin, name);
    }
    if (++column == static_cast<std::size_t>(layout.mcus_per_row)) {
      column = 0;
      ++row;
    }
  }
  const std::size_t used = reader.consumed(), available = bytes.size() * 8;
  const bool filler =
      !segment.whole || used + 8 > available ||
      libjpeg::is_filler(bytes.data(), bytes.data() + bytes.size(), (available - used) / 8);
  if (used <= available && filler) return;
  fail(used > available ? "a restart segment is too short" : "a restart segment is too long",
       segment.begin, name);
}

}  // namespace raystage::store
