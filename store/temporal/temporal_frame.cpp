// SPDX-License-Identifier: Apache-2.0
#include "store/temporal/temporal_frame.h"

#include <xxhash.h>

#include <algorithm>
#include <array>

namespace raystage::store {
namespace {

// Names the link among other units of its kind. Without zeros: HEVC would escape them.
constexpr std::array<std::uint8_t, 16> kLinkUuid{0x8d, 0x1f, 0x52, 0xc6, 0x3b, 0x94, 0x4e, 0x7a,
                                                 0xb1, 0x72, 0x61, 0x79, 0x73, 0x74, 0x67, 0x65};
constexpr std::uint8_t kLinkVersion = 0x81;
// Numbers are in groups of 7 bits, the lowest first, each in a byte with its top bit set.
constexpr std::size_t kPositionBytes = 3, kSizeBytes = 5, kHashBytes = 10;
constexpr std::size_t kPayloadBytes =
    kLinkUuid.size() + 1 + kPositionBytes + kHashBytes + kSizeBytes + kHashBytes;

// HEVC: start code, NAL unit 39 (prefix SEI), message 5 (user data, unregistered) and its size.
constexpr std::array<std::uint8_t, 8> kHevcStart{0, 0, 0, 1, 0x4e, 0x01, 5, kPayloadBytes};
// AV1: padding (type 15) with a size, which counts the trailing bits.
constexpr std::array<std::uint8_t, 2> kAv1Start{0x7a, kPayloadBytes + 1};
constexpr std::uint8_t kTrailingBits = 0x80;
static_assert(kFrameLinkBytes == kHevcStart.size() + kPayloadBytes + 1);

// The temporal delimiter, which Matroska leaves out.
constexpr std::array<std::uint8_t, 2> kDelimiter{0x12, 0};

template <std::size_t kSize>
bool begins_with(std::span<const std::byte> bytes, const std::array<std::uint8_t, kSize>& start) {
  return bytes.size() >= kSize &&
         std::ranges::equal(bytes.first(kSize), start, {},
                            [](std::byte byte) { return std::to_integer<std::uint8_t>(byte); });
}

template <class Bytes>
void append_bytes(std::vector<std::byte>& to, const Bytes& bytes) {
  for (const std::uint8_t byte : bytes) to.push_back(static_cast<std::byte>(byte));
}

void append_number(std::vector<std::byte>& to, std::uint64_t number, std::size_t count) {
  for (std::size_t i = 0; i < count; ++i) {
    to.push_back(static_cast<std::byte>(0x80U | (number >> (7 * i) & 0x7fU)));
  }
}

/// Takes a number from the beginning of `bytes`; nullopt if a byte is not of one.
std::optional<std::uint64_t> take_number(std::span<const std::byte>& bytes, std::size_t count) {
  std::uint64_t number = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const auto byte = std::to_integer<std::uint64_t>(bytes[i]);
    if (byte < 0x80) return std::nullopt;
    number |= (byte & 0x7fU) << (7 * i);
  }
  bytes = bytes.subspan(count);
  return number;
}

}  // namespace

const char* name_of(VideoCodec codec) { return codec == VideoCodec::kHevc ? "HEVC" : "AV1"; }

std::vector<std::byte> make_temporal_frame(VideoCodec codec, const FrameLink& link,
                                           std::span<const std::byte> packet) {
  std::vector<std::byte> frame;
  frame.reserve(kFrameLinkBytes + packet.size());
  if (codec == VideoCodec::kHevc) {
    append_bytes(frame, kHevcStart);
  } else {
    append_bytes(frame, kAv1Start);
    if (begins_with(packet, kDelimiter)) packet = packet.subspan(kDelimiter.size());
  }
  append_bytes(frame, kLinkUuid);
  frame.push_back(static_cast<std::byte>(kLinkVersion));
  append_number(frame, link.position, kPositionBytes);
  append_number(frame, link.previous, kHashBytes);
  append_number(frame, link.source_bytes, kSizeBytes);
  append_number(frame, link.source_xxh3, kHashBytes);
  frame.push_back(static_cast<std::byte>(kTrailingBits));
  frame.insert(frame.end(), packet.begin(), packet.end());
  return frame;
}

std::optional<FrameLink> read_frame_link(std::span<const std::byte> frame) {
  const bool is_hevc = begins_with(frame, kHevcStart);
  if (!is_hevc && !begins_with(frame, kAv1Start)) return std::nullopt;
  std::span<const std::byte> rest = frame.subspan(is_hevc ? kHevcStart.size() : kAv1Start.size());
  if (rest.size() < kPayloadBytes || !begins_with(rest, kLinkUuid)) return std::nullopt;
  rest = rest.subspan(kLinkUuid.size());
  if (rest[0] != static_cast<std::byte>(kLinkVersion)) return std::nullopt;
  rest = rest.subspan(1);
  const auto position = take_number(rest, kPositionBytes);
  if (!position) return std::nullopt;
  const auto previous = take_number(rest, kHashBytes);
  if (!previous) return std::nullopt;
  const auto size = take_number(rest, kSizeBytes);
  if (!size || *size > 0xffffffffU) return std::nullopt;
  const auto hash = take_number(rest, kHashBytes);
  if (!hash || *position >= kMaxGroupFrames) return std::nullopt;
  return FrameLink{static_cast<std::uint32_t>(*position), *previous,
                   static_cast<std::uint32_t>(*size), *hash};
}

bool is_key_frame(std::span<const std::byte> frame) {
  const auto link = read_frame_link(frame);
  return !link || link->position == 0;
}

std::uint64_t hash_of_stored(std::span<const std::byte> frame) {
  return XXH3_64bits(frame.data(), frame.size());
}

}  // namespace raystage::store
