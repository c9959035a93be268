// SPDX-License-Identifier: Apache-2.0
#include "store/jpeg/raw_image.h"

namespace raystage::store {
namespace {

int rounded_half(int size) { return (size + 1) / 2; }

}  // namespace

bool is_yuv(PixelFormat format) {
  return format == PixelFormat::kYuv420 || format == PixelFormat::kYuv422 ||
         format == PixelFormat::kYuv444;
}

bool halves_chroma_width(PixelFormat format) {
  return format == PixelFormat::kYuv420 || format == PixelFormat::kYuv422;
}

int RawImage::plane_count() const { return is_yuv(format) ? 3 : 1; }

std::size_t RawImage::row_bytes(int plane) const {
  if (format == PixelFormat::kRgb || format == PixelFormat::kBgr)
    return 3 * static_cast<std::size_t>(width);
  return static_cast<std::size_t>(plane > 0 && halves_chroma_width(format) ? rounded_half(width)
                                                                           : width);
}

int RawImage::rows(int plane) const {
  return plane > 0 && format == PixelFormat::kYuv420 ? rounded_half(height) : height;
}

std::size_t RawImage::bytes() const {
  std::size_t sum = 0;
  for (int plane = 0; plane < plane_count(); ++plane) {
    sum += row_bytes(plane) * static_cast<std::size_t>(rows(plane));
  }
  return sum;
}

std::size_t RawImage::bytes_in_memory() const {
  std::size_t sum = 0;
  for (int plane = 0; plane < plane_count(); ++plane) {
    sum += planes[plane].stride * static_cast<std::size_t>(rows(plane));
  }
  return sum;
}

}  // namespace raystage::store
