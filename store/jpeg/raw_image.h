// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>

namespace raystage::store {

/// Pixel formats that libjpeg encodes without conversion. YUV is full range with the Rec.601 matrix
/// (JFIF), in planes. 4:2:0 and 4:2:2 halve the chroma width, rounded up; 4:2:0 also halves its
/// height.
enum class PixelFormat : std::uint8_t { kYuv420, kYuv422, kYuv444, kGray, kRgb, kBgr };
bool is_yuv(PixelFormat format);
bool halves_chroma_width(PixelFormat format);

/// One uncompressed picture. YUV has three planes, other formats one. `owner` keeps the bytes
/// alive, so that a driver's buffer need not be copied.
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
  /// Returns the bytes per row of a plane, without padding; rows() returns its number of rows.
  std::size_t row_bytes(int plane) const;
  int rows(int plane) const;
  /// Returns the bytes of all pixels, without padding.
  std::size_t bytes() const;
  /// Returns the bytes with the padding of rows; 0 for an empty image.
  std::size_t bytes_in_memory() const;
};

}  // namespace raystage::store
