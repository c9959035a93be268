// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <OpenEXR/ImfFrameBuffer.h>

#include <cstddef>
#include <cstdint>

namespace raystage::images {

/// Returns a slice over a window that is `width` pixels wide and starts at (x0, y0), with
/// `channels` samples per pixel. OpenEXR needs the address of pixel (0, 0), which may be outside
/// the memory, so it is computed as an integer. `fill` is the value if the file lacks the channel.
template <class T>
Imf::Slice make_exr_slice(Imf::PixelType type, T* first, int width, int channels, int x0, int y0,
                          double fill) {
  const auto x_stride = static_cast<std::intptr_t>(sizeof(T)) * channels;
  const std::intptr_t y_stride = x_stride * width;
  const std::intptr_t base = reinterpret_cast<std::intptr_t>(first) - x0 * x_stride - y0 * y_stride;
  return {type,
          reinterpret_cast<char*>(base),
          static_cast<std::size_t>(x_stride),
          static_cast<std::size_t>(y_stride),
          1,
          1,
          fill};
}

}  // namespace raystage::images
