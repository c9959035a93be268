// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

namespace raystage::store {

/// Most bytes of a frame as JPEG: 65535 x 65535 pixels take 40 MB and more.
inline constexpr std::uint32_t kMaxFrameBytes = std::uint32_t{256} << 20;

/// What a packed frame states about the JPEG that it was made from.
struct JpegFixity {
  std::uint32_t size = 0;  ///< bytes
  std::uint64_t xxh3 = 0;  ///< XXH3-64 of the bytes
  bool operator==(const JpegFixity&) const = default;
};

/// Bytes at the beginning of a packed frame that read_jpeg_fixity() needs.
inline constexpr std::size_t kPackedHeaderBytes = 72;

/// Returns the fixity of a JPEG.
JpegFixity fixity_of(std::span<const std::byte> jpeg);

/// Returns whether bytes begin as a JPEG XL container does. No JPEG begins so.
bool is_jpeg_xl(std::span<const std::byte> bytes);

/// Returns a packed frame (docs/formats/archive.md): the JPEG XL container with a box that states
/// the JPEG's fixity. Throws Error (bad input) if `container` does not begin as libjxl's do.
std::vector<std::byte> add_jpeg_fixity(std::span<const std::byte> container,
                                       const JpegFixity& fixity);

/// Returns what a packed frame states, from its first kPackedHeaderBytes or more; nullopt if the
/// bytes do not begin as a packed frame or the stated size is 0 or above kMaxFrameBytes.
std::optional<JpegFixity> read_jpeg_fixity(std::span<const std::byte> packed);

}  // namespace raystage::store
