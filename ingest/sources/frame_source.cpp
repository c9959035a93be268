// SPDX-License-Identifier: Apache-2.0
#include "ingest/sources/frame_source.h"

namespace raystage {

std::size_t RawImage::bytes() const {
  const auto w = static_cast<std::size_t>(width), h = static_cast<std::size_t>(height);
  const std::size_t half_w = (w + 1) / 2, half_h = (h + 1) / 2;
  switch (format) {
    case PixelFormat::kYuv420:
      return w * h + 2 * half_w * half_h;
    case PixelFormat::kYuv422:
      return w * h + 2 * half_w * h;
    case PixelFormat::kGray:
      return w * h;
    case PixelFormat::kYuv444:
    case PixelFormat::kRgb:
    case PixelFormat::kBgr:
      break;
  }
  return w * h * 3;
}

Nanoseconds host_utc_now() {
  const auto since_1970 = std::chrono::system_clock::now().time_since_epoch();
  return std::chrono::duration_cast<std::chrono::nanoseconds>(since_1970).count();
}

}  // namespace raystage
