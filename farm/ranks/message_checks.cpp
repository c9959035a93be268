// SPDX-License-Identifier: Apache-2.0
#include "farm/ranks/message_checks.h"

#include <algorithm>
#include <array>
#include <cstdint>

namespace raystage::farm {
namespace {

/// Returns whether the segments are in order, and those of a scan of so many blocks.
bool has_valid_segments(const store::JpegLayout& l, int blocks_per_mcu) {
  // A coefficient has at most 32 bits (T.81 F.1.2), and a stuffed byte takes two.
  constexpr std::int64_t kMaxBlockBytes = 64 * 4 * 2, kMaxMarkerBytes = 8;
  const std::int64_t mcus = l.mcu_count();
  const std::int64_t segments =
      l.restart_interval > 0 ? (mcus + l.restart_interval - 1) / l.restart_interval : 1;
  const auto& offsets = l.segment_offset;
  if (static_cast<std::int64_t>(offsets.size()) != segments + 1) return false;
  const bool are_in_order =
      std::ranges::adjacent_find(offsets, [](std::int64_t offset, std::int64_t next) {
        return next < offset + 2;  // a restart marker
      }) == offsets.end();
  const std::int64_t most_bytes =
      kMaxBlockBytes * blocks_per_mcu * mcus + kMaxMarkerBytes * segments;
  return are_in_order && offsets.front() == l.scan_offset && offsets.back() >= 2 &&
         offsets.back() - 2 == l.scan_end && l.sof_offset < l.scan_offset &&
         (!l.baseline_ycc || offsets.back() - offsets.front() <= most_bytes);
}

}  // namespace

bool is_shallow_cbor(std::span<const std::byte> cbor) {
  std::array<std::uint64_t, 16> left{};  // by level: items that are still to come
  std::size_t levels = 0;
  while (!cbor.empty()) {
    const auto initial = std::to_integer<unsigned>(cbor[0]);
    const unsigned type = initial >> 5, info = initial & 31;  // RFC 8949, section 3
    cbor = cbor.subspan(1);
    std::uint64_t argument = info;
    if (info >= 24) {
      const std::size_t bytes = std::size_t{1} << (info - 24);
      if (info > 27 || bytes > cbor.size()) return false;
      argument = 0;
      for (const std::byte byte : cbor.first(bytes)) {
        argument = argument << 8 | std::to_integer<std::uint64_t>(byte);
      }
      cbor = cbor.subspan(bytes);
    }
    const bool is_string = type == 2 || type == 3, is_map = type == 5;
    const bool is_container = type == 4 || is_map;
    if (type == 6 || ((is_string || is_container) && argument > cbor.size())) return false;
    if (is_string) cbor = cbor.subspan(static_cast<std::size_t>(argument));
    if (is_container && argument > 0) {
      if (levels == left.size()) return false;
      left[levels++] = is_map ? 2 * argument : argument;
      continue;
    }
    while (levels > 0 && --left[levels - 1] == 0) --levels;
  }
  return true;
}

bool is_valid_layout(const store::JpegLayout& l) {
  constexpr int kMaxSide = 65535, kMaxFactor = 4, kMaxBlocksPerMcu = 10;
  const auto is_within = [](int value, int most) { return value > 0 && value <= most; };
  if (!is_within(l.width, kMaxSide) || !is_within(l.height, kMaxSide)) return false;
  if (l.components != 1 && l.components != 3) return false;
  int h_max = 1, v_max = 1, blocks = 0;
  for (int c = 0; c < l.components; ++c) {
    if (!is_within(l.h[c], kMaxFactor) || !is_within(l.v[c], kMaxFactor)) return false;
    h_max = std::max(h_max, l.h[c]);
    v_max = std::max(v_max, l.v[c]);
    blocks += l.h[c] * l.v[c];
  }
  for (int c = 0; c < l.components && l.baseline_ycc; ++c) {
    if (h_max % l.h[c] != 0 || v_max % l.v[c] != 0) return false;
  }
  return l.mcu_width == 8 * h_max && l.mcu_height == 8 * v_max &&
         l.mcus_per_row == (l.width + l.mcu_width - 1) / l.mcu_width &&
         l.mcu_rows == (l.height + l.mcu_height - 1) / l.mcu_height && l.restart_interval >= 0 &&
         (l.baseline_ycc ? blocks <= kMaxBlocksPerMcu : l.restart_interval == 0) &&
         has_valid_segments(l, blocks);
}

}  // namespace raystage::farm
