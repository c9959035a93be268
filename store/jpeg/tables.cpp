// SPDX-License-Identifier: Apache-2.0
// Reads the quantisation and Huffman tables of a baseline scan (ITU-T T.81 B.2.4, annex C). Codes
// of up to 10 bits are found by one lookup in a table of 1024 entries, longer codes by comparison
// with the limit of each length (F.2.2.3). Frames without Huffman tables use the standard ones of
// annex K.3.
#include "store/jpeg/tables.h"

#include <algorithm>

#include "store/jpeg/markers.h"

namespace raystage::store {
namespace {

using Counts = std::array<std::uint8_t, HuffmanTable::kMaxBits>;

// ITU-T T.81 tables K.3-K.6.
constexpr std::uint8_t kDcSymbols[] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11};
constexpr Counts kDcLuminanceCounts{0, 1, 5, 1, 1, 1, 1, 1, 1};
constexpr Counts kDcChrominanceCounts{0, 3, 1, 1, 1, 1, 1, 1, 1, 1, 1};
constexpr Counts kAcLuminanceCounts{0, 2, 1, 3, 3, 2, 4, 3, 5, 5, 4, 4, 0, 0, 1, 125};
constexpr std::uint8_t kAcLuminanceSymbols[] = {
    0x01, 0x02, 0x03, 0x00, 0x04, 0x11, 0x05, 0x12, 0x21, 0x31, 0x41, 0x06, 0x13, 0x51, 0x61,
    0x07, 0x22, 0x71, 0x14, 0x32, 0x81, 0x91, 0xa1, 0x08, 0x23, 0x42, 0xb1, 0xc1, 0x15, 0x52,
    0xd1, 0xf0, 0x24, 0x33, 0x62, 0x72, 0x82, 0x09, 0x0a, 0x16, 0x17, 0x18, 0x19, 0x1a, 0x25,
    0x26, 0x27, 0x28, 0x29, 0x2a, 0x34, 0x35, 0x36, 0x37, 0x38, 0x39, 0x3a, 0x43, 0x44, 0x45,
    0x46, 0x47, 0x48, 0x49, 0x4a, 0x53, 0x54, 0x55, 0x56, 0x57, 0x58, 0x59, 0x5a, 0x63, 0x64,
    0x65, 0x66, 0x67, 0x68, 0x69, 0x6a, 0x73, 0x74, 0x75, 0x76, 0x77, 0x78, 0x79, 0x7a, 0x83,
    0x84, 0x85, 0x86, 0x87, 0x88, 0x89, 0x8a, 0x92, 0x93, 0x94, 0x95, 0x96, 0x97, 0x98, 0x99,
    0x9a, 0xa2, 0xa3, 0xa4, 0xa5, 0xa6, 0xa7, 0xa8, 0xa9, 0xaa, 0xb2, 0xb3, 0xb4, 0xb5, 0xb6,
    0xb7, 0xb8, 0xb9, 0xba, 0xc2, 0xc3, 0xc4, 0xc5, 0xc6, 0xc7, 0xc8, 0xc9, 0xca, 0xd2, 0xd3,
    0xd4, 0xd5, 0xd6, 0xd7, 0xd8, 0xd9, 0xda, 0xe1, 0xe2, 0xe3, 0xe4, 0xe5, 0xe6, 0xe7, 0xe8,
    0xe9, 0xea, 0xf1, 0xf2, 0xf3, 0xf4, 0xf5, 0xf6, 0xf7, 0xf8, 0xf9, 0xfa};
constexpr Counts kAcChrominanceCounts{0, 2, 1, 2, 4, 4, 3, 4, 7, 5, 4, 4, 0, 1, 2, 119};
constexpr std::uint8_t kAcChrominanceSymbols[] = {
    0x00, 0x01, 0x02, 0x03, 0x11, 0x04, 0x05, 0x21, 0x31, 0x06, 0x12, 0x41, 0x51, 0x07, 0x61,
    0x71, 0x13, 0x22, 0x32, 0x81, 0x08, 0x14, 0x42, 0x91, 0xa1, 0xb1, 0xc1, 0x09, 0x23, 0x33,
    0x52, 0xf0, 0x15, 0x62, 0x72, 0xd1, 0x0a, 0x16, 0x24, 0x34, 0xe1, 0x25, 0xf1, 0x17, 0x18,
    0x19, 0x1a, 0x26, 0x27, 0x28, 0x29, 0x2a, 0x35, 0x36, 0x37, 0x38, 0x39, 0x3a, 0x43, 0x44,
    0x45, 0x46, 0x47, 0x48, 0x49, 0x4a, 0x53, 0x54, 0x55, 0x56, 0x57, 0x58, 0x59, 0x5a, 0x63,
    0x64, 0x65, 0x66, 0x67, 0x68, 0x69, 0x6a, 0x73, 0x74, 0x75, 0x76, 0x77, 0x78, 0x79, 0x7a,
    0x82, 0x83, 0x84, 0x85, 0x86, 0x87, 0x88, 0x89, 0x8a, 0x92, 0x93, 0x94, 0x95, 0x96, 0x97,
    0x98, 0x99, 0x9a, 0xa2, 0xa3, 0xa4, 0xa5, 0xa6, 0xa7, 0xa8, 0xa9, 0xaa, 0xb2, 0xb3, 0xb4,
    0xb5, 0xb6, 0xb7, 0xb8, 0xb9, 0xba, 0xc2, 0xc3, 0xc4, 0xc5, 0xc6, 0xc7, 0xc8, 0xc9, 0xca,
    0xd2, 0xd3, 0xd4, 0xd5, 0xd6, 0xd7, 0xd8, 0xd9, 0xda, 0xe2, 0xe3, 0xe4, 0xe5, 0xe6, 0xe7,
    0xe8, 0xe9, 0xea, 0xf2, 0xf3, 0xf4, 0xf5, 0xf6, 0xf7, 0xf8, 0xf9, 0xfa};

std::span<const std::uint8_t> bytes_of(std::span<const std::byte> body) {
  return {reinterpret_cast<const std::uint8_t*>(body.data()), body.size()};
}

class TableReader {
 public:
  TableReader(std::span<const std::byte> jpeg, std::string_view name, ScanTables& tables)
      : markers_(jpeg, name), tables_(tables) {}

  void read(const JpegLayout& layout) {
    tables_ = {};
    markers_.read_soi();
    for (;;) {
      const Marker marker = markers_.next();
      if (marker.code == kMarkerDqt) read_quantisation(marker);
      if (marker.code == kMarkerDht) read_huffman(marker);
      if (marker.offset == layout.sof_offset) frame_ = marker;
      if (marker.code != kMarkerSos) continue;
      read_scan(marker, layout.components);
      return;
    }
  }

 private:
  void read_quantisation(const Marker& marker);
  void read_huffman(const Marker& marker);
  void read_scan(const Marker& marker, int components);

  MarkerReader markers_;
  ScanTables& tables_;
  Marker frame_;
  std::array<std::array<std::uint16_t, 64>, 4> quantisation_{};
  std::array<bool, 4> quantisation_defined_{};
};

void TableReader::read_quantisation(const Marker& marker) {
  const std::span<const std::uint8_t> body = bytes_of(marker.body);
  for (std::size_t at = 0; at < body.size();) {
    const int index = body[at] & 15, wide = body[at] >> 4;
    ++at;
    if (index > 3 || wide > 1 || body.size() - at < (wide ? 128u : 64u))
      markers_.fail(marker.offset, "the DQT marker is damaged");
    for (auto& step : quantisation_[index]) {
      step = wide ? static_cast<std::uint16_t>(body[at] << 8 | body[at + 1]) : body[at];
      at += wide ? 2 : 1;
    }
    quantisation_defined_[index] = true;
  }
}

void TableReader::read_huffman(const Marker& marker) {
  const std::span<const std::uint8_t> body = bytes_of(marker.body);
  for (std::size_t at = 0; at < body.size();) {
    if (body.size() - at < 17) markers_.fail(marker.offset, "the DHT marker is damaged");
    const bool dc = body[at] >> 4 == 0;
    const std::size_t index = body[at] & 15;
    Counts counts;
    std::copy_n(body.begin() + static_cast<std::ptrdiff_t>(at + 1), counts.size(), counts.begin());
    at += 17;
    std::size_t count = 0;
    for (const std::uint8_t c : counts) count += c;
    if (body[at - 17] >> 4 > 1 || index > 3 || count > 256 || body.size() - at < count)
      markers_.fail(marker.offset, "the DHT marker is damaged");
    HuffmanTable& table = dc ? tables_.dc[index] : tables_.ac[index];
    if (!table.build(counts, body.subspan(at, count), dc))
      markers_.fail(marker.offset, "the DHT marker defines no Huffman code");
    at += count;
  }
}

void TableReader::read_scan(const Marker& marker, int components) {
  const auto needed = static_cast<std::size_t>(components);
  // The layout of a frame on another host may be that of other bytes.
  if (frame_.body.size() < 6 + 3 * needed || marker.body.size() < 1 + 2 * needed)
    markers_.fail(marker.offset, "the frame is not the one that its layout describes");
  if (!tables_.dc[0].defined()) tables_.dc[0].build(kDcLuminanceCounts, kDcSymbols, true);
  if (!tables_.ac[0].defined()) tables_.ac[0].build(kAcLuminanceCounts, kAcLuminanceSymbols, false);
  if (!tables_.dc[1].defined()) tables_.dc[1].build(kDcChrominanceCounts, kDcSymbols, true);
  if (!tables_.ac[1].defined())
    tables_.ac[1].build(kAcChrominanceCounts, kAcChrominanceSymbols, false);
  for (std::size_t c = 0; c < static_cast<std::size_t>(components); ++c) {
    const int selectors = std::to_integer<int>(marker.body[2 + 2 * c]);
    const auto dc = static_cast<std::size_t>(selectors >> 4);
    const auto ac = static_cast<std::size_t>(selectors & 15);
    if (dc > 3 || ac > 3 || !tables_.dc[dc].defined() || !tables_.ac[ac].defined())
      markers_.fail(marker.offset, "the scan uses a missing Huffman table");
    tables_.dc_table[c] = static_cast<int>(dc);
    tables_.ac_table[c] = static_cast<int>(ac);
    const auto index = std::to_integer<std::size_t>(frame_.body[6 + 3 * c + 2]);
    if (index > 3 || !quantisation_defined_[index])
      markers_.fail(marker.offset, "the scan uses a missing quantisation table");
    auto& steps = tables_.quantisation[c];
    std::copy(quantisation_[index].begin(), quantisation_[index].end(), steps.begin());
    std::fill(steps.begin() + 64, steps.end(), quantisation_[index].back());
  }
}

}  // namespace

HuffmanEntry HuffmanTable::make_entry(int symbol, int length) {
  HuffmanEntry entry;
  entry.code_length = static_cast<std::uint8_t>(length);
  entry.value_bits = static_cast<std::uint8_t>(symbol & 15);
  entry.total_length = static_cast<std::uint8_t>(length + entry.value_bits);
  const int run = symbol >> 4;
  if (entry.value_bits == 0 && run != 15) {
    entry.advance = 64;
  } else {
    entry.advance = static_cast<std::uint8_t>(run + 1);
  }
  return entry;
}

bool HuffmanTable::build(std::span<const std::uint8_t, kMaxBits> counts,
                         std::span<const std::uint8_t> symbols, bool dc) {
  std::copy(symbols.begin(), symbols.end(), symbols_.begin());
  lookup_.fill({});
  std::uint32_t code = 0;  // left-aligned in kMaxBits bits
  std::size_t next = 0;
  for (int length = 1; length <= kMaxBits; ++length) {
    const std::uint32_t step = 1u << (kMaxBits - length);
    offset_[length] = static_cast<std::int32_t>(next) - static_cast<std::int32_t>(code / step);
    for (int i = 0; i < counts[length - 1]; ++i, ++next, code += step) {
      if (code + step >= 1u << kMaxBits) return false;  // no code is all ones
      const int symbol = symbols[next];
      if (dc && symbol > 15) return false;
      if (length > kLookupBits) continue;
      const auto first = lookup_.begin() + (code >> (kMaxBits - kLookupBits));
      std::fill_n(first, 1 << (kLookupBits - length), make_entry(symbol, length));
    }
    limit_[length] = code;
  }
  defined_ = true;
  return true;
}

HuffmanEntry HuffmanTable::find(std::uint32_t bits) const {
  for (int length = 1; length <= kMaxBits; ++length) {
    if (bits >= limit_[length]) continue;
    const auto at = offset_[length] + static_cast<std::int32_t>(bits >> (kMaxBits - length));
    return make_entry(symbols_[at], length);
  }
  return {};
}

void read_scan_tables(std::span<const std::byte> jpeg, const JpegLayout& layout,
                      std::string_view name, ScanTables& tables) {
  TableReader(jpeg, name, tables).read(layout);
}

}  // namespace raystage::store
