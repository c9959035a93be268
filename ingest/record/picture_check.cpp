// SPDX-License-Identifier: Apache-2.0
#include "ingest/record/picture_check.h"

#include <cstdint>

namespace raystage {
namespace {

constexpr std::uint8_t kMarker = 0xFF, kSoi = 0xD8, kEoi = 0xD9, kSos = 0xDA, kTem = 0x01;
constexpr std::uint8_t kDht = 0xC4, kJpg = 0xC8, kDac = 0xCC;

bool starts_a_frame(std::uint8_t marker) {
  return marker >= 0xC0 && marker <= 0xCF && marker != kDht && marker != kJpg && marker != kDac;
}

/// Some cameras fill up to a packet's size behind the end.
std::span<const std::byte> without_filler(std::span<const std::byte> jpeg) {
  while (!jpeg.empty() && jpeg.back() == std::byte{0}) jpeg = jpeg.first(jpeg.size() - 1);
  return jpeg;
}

}  // namespace

FrameStatus check_jpeg(std::span<const std::byte> jpeg, int width, int height) {
  jpeg = without_filler(jpeg);
  const auto byte = [&](std::size_t at) { return std::to_integer<std::uint8_t>(jpeg[at]); };
  const auto word = [&](std::size_t at) { return byte(at) << 8 | byte(at + 1); };
  const std::size_t size = jpeg.size();
  if (size < 4 || byte(0) != kMarker || byte(1) != kSoi || byte(size - 2) != kMarker ||
      byte(size - 1) != kEoi) {
    return FrameStatus::kTorn;
  }
  for (std::size_t at = 2; at + 4 <= size;) {
    if (byte(at) != kMarker) return FrameStatus::kTorn;
    const std::uint8_t marker = byte(at + 1);
    if (marker == kMarker) {  // padding before a marker
      ++at;
      continue;
    }
    if (marker == kTem || (marker >= 0xD0 && marker <= 0xD7)) {
      at += 2;
      continue;
    }
    if (marker == kSos || marker == kEoi) return FrameStatus::kTorn;  // no frame header so far
    const auto length = static_cast<std::size_t>(word(at + 2));
    if (length < 2 || at + 2 + length > size) return FrameStatus::kTorn;
    if (starts_a_frame(marker)) {
      if (length < 8) return FrameStatus::kTorn;
      const bool fits = word(at + 5) == height && word(at + 7) == width;
      return fits ? FrameStatus::kStored : FrameStatus::kUnreadable;
    }
    at += 2 + length;
  }
  return FrameStatus::kTorn;
}

}  // namespace raystage
