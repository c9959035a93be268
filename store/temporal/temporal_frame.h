// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace raystage::store {

/// Video codecs of temporal archives.
enum class VideoCodec : std::uint8_t { kHevc = 1, kAv1 = 2 };
const char* name_of(VideoCodec codec);

/// Most frames of a group: a frame is decoded with all frames of its group.
inline constexpr int kMaxGroupFrames = 256;
/// Most bytes of the stored frames of a group, which are in memory together: those of 20 frames of
/// 12 megapixels have 0.1 to 0.3 GiB.
inline constexpr std::uint64_t kMaxGroupBytes = std::uint64_t{1} << 30;

/// What a temporal frame states about itself, so that it is never decoded with wrong references.
struct FrameLink {
  std::uint32_t position = 0;      ///< in its group; 0: decoded without other frames
  std::uint64_t previous = 0;      ///< XXH3-64 of the stored bytes before it in the group; 0: none
  std::uint32_t source_bytes = 0;  ///< size of the JPEG that was encoded
  std::uint64_t source_xxh3 = 0;   ///< XXH3-64 of that JPEG
  bool operator==(const FrameLink&) const = default;
};

/// Bytes at the beginning of a temporal frame that read_frame_link() needs.
inline constexpr std::size_t kFrameLinkBytes = 54;

/// Returns a temporal frame (docs/formats/archive.md): the link in a unit that decoders skip (HEVC:
/// SEI, AV1: padding), then the packet as the encoder wrote it, AV1 without temporal delimiter.
std::vector<std::byte> make_temporal_frame(VideoCodec codec, const FrameLink& link,
                                           std::span<const std::byte> packet);

/// Returns what a temporal frame states, from its first kFrameLinkBytes or more; nullopt of other
/// bytes, such as a JPEG.
std::optional<FrameLink> read_frame_link(std::span<const std::byte> frame);

/// Returns whether the bytes of a stored frame can be decoded without others: Matroska's key frame.
bool is_key_frame(std::span<const std::byte> frame);

/// Returns the XXH3-64 of stored bytes, as FrameLink::previous has it.
std::uint64_t hash_of_stored(std::span<const std::byte> frame);

}  // namespace raystage::store
