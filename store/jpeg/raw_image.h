// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>

namespace raystage {

/// Pixels that libjpeg encodes without another conversion. YUV is full range with Rec.601's matrix
/// (JFIF), in planes; 4:2:0 and 4:2:2 halve the chroma's width rounding up, 4:2:0 its height too.
enum class PixelFormat : std::uint8_t { kYuv420, kYuv422, kYuv444, kGray, kRgb, kBgr };

/// One uncompressed picture. YUV has three planes, the others one. `owner` keeps the bytes alive,
/// so that a driver's buffer need not be copied.
struct RawImage {
  struct Plane {
    const std::byte* data = nullptr;
    std::size_t stride = 0;  ///< bytes from row to row
  };
  PixelFormat format = PixelFormat::kYuv420;
  int width = 0, height = 0;  ///< pixels
  std::array<Plane, 3> planes{};
  std::shared_ptr<const void> owner;

  int plane_count() const;
  /// Bytes of a row and number of rows of a plane, without padding.
  std::size_t row_bytes(int plane) const;
  int rows(int plane) const;
  /// Bytes of all pixels, without padding.
  std::size_t bytes() const;
  /// The same with the padding of rows; 0 for one that is empty.
  std::size_t bytes_in_memory() const;
};

}  // namespace raystage
