// SPDX-License-Identifier: Apache-2.0
// Finds restart markers in JPEG data: bytes 0xFF followed by 0xD0 to 0xD7, a vector of bytes at a
// time. Cost: O(bytes). The tests compare it with a byte-by-byte search.
#include "store/jpeg/marker_search.h"

#include <algorithm>
#include <bit>
#include <cstring>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "store/jpeg/marker_search.cpp"
// foreach_target.h must come first.
// clang-format off
#include <hwy/foreach_target.h>
#include <hwy/highway.h>
// clang-format on

HWY_BEFORE_NAMESPACE();
namespace raystage::store {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// Finds markers: 0xFF followed by neither 0x00 (stuffed data byte) nor 0xFF (fill byte). Scans have
// a stuffed byte every 100 bytes or so; vectors handle them without a branch.
void FindRestartMarkers(const std::uint8_t* bytes, std::size_t at, std::size_t end,
                        std::vector<std::uint32_t>& found) {
  // Returns whether the search continues.
  const auto take = [&](std::size_t offset) {
    const std::uint8_t code = bytes[offset + 1];
    if (code == 0xFF) return true;
    found.push_back(static_cast<std::uint32_t>(offset));
    return code >= 0xD0 && code <= 0xD7;
  };
#if HWY_TARGET != HWY_SCALAR
  constexpr hn::CappedTag<std::uint8_t, 64> kBytes;
  constexpr std::size_t kLanes = hn::MaxLanes(kBytes);
  for (; at + kLanes < end; at += hn::Lanes(kBytes)) {
    const auto here = hn::LoadU(kBytes, bytes + at), next = hn::LoadU(kBytes, bytes + at + 1);
    const auto hits = hn::And(hn::Eq(here, hn::Set(kBytes, 0xFF)), hn::Ne(next, hn::Zero(kBytes)));
    if (HWY_LIKELY(hn::AllFalse(kBytes, hits))) continue;
    std::uint8_t stored[8] = {};
    hn::StoreMaskBits(kBytes, hits, stored);
    std::uint64_t bits;
    std::memcpy(&bits, stored, sizeof(bits));
    for (; bits != 0; bits &= bits - 1)
      if (!take(at + static_cast<std::size_t>(std::countr_zero(bits)))) return;
  }
#endif
  for (; at + 1 < end; ++at)
    if (bytes[at] == 0xFF && bytes[at + 1] != 0 && !take(at)) return;
}

}  // namespace HWY_NAMESPACE
}  // namespace raystage::store
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace raystage::store {

HWY_EXPORT(FindRestartMarkers);

std::vector<std::uint32_t> find_restart_markers(std::span<const std::byte> bytes,
                                                std::size_t begin) {
  std::vector<std::uint32_t> found;
  found.reserve(64);
  const auto* data = reinterpret_cast<const std::uint8_t*>(bytes.data());
  HWY_DYNAMIC_DISPATCH(FindRestartMarkers)
  (data, begin, std::min<std::size_t>(bytes.size(), UINT32_MAX), found);
  return found;
}

}  // namespace raystage::store
#endif
